"""The design room: the mission that is flown and the parameter sets that are compared on it."""
