"""The design room: the mission that is flown and the parameter sets that are compared on it."""

from fusetune.design.outputs import write_design

__all__ = ["write_design"]
