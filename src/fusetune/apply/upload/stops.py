"""Why an upload does not begin, or does not go on."""

from __future__ import annotations


class Refusal(Exception):
    """Nothing is written: the vehicle is not the one, or not in the state, that values may be written to.

    Parameters
    ----------
    reason, remedy
        In sentences without a final full stop.
    """

    def __init__(self, reason: str, remedy: str) -> None:
        self.reason, self.remedy = reason, remedy
        super().__init__(reason, remedy)

    def __str__(self) -> str:
        return f"{self.reason}. {self.remedy}."


class Stopped(Exception):
    """Writing cannot go on as it was meant; what was written is taken back."""


class Armed(Stopped):
    """The vehicle is armed, or flies."""


class LinkLost(Stopped):
    """Nothing comes from the vehicle any more."""


class NoAnswer(Stopped):
    """The vehicle is there, and does not answer."""


class NotTaken(Stopped):
    """The vehicle does not take a value."""


class ChangedMeanwhile(Stopped):
    """A value that was never written to is another one than before: somebody else writes, too."""


class NotTheVehicle(Stopped):
    """What answers now is another vehicle."""
