"""PX4's parameters: metadata per release, names of other releases, what a log holds, QGroundControl's files."""
