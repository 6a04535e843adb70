"""PX4's names and file formats: topics, parameters, ULog, QGroundControl's parameter and plan files."""
