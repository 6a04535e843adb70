"""What a flight tells of one effect that parameters of PX4 describe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Estimate:
    """A value with its interval.

    Attributes
    ----------
    name : PX4's parameter where there is one, as `EKF2_BCOEF_X`; else what is estimated, as `motor_field_x`
    told : what the vehicle flew with; None where no parameter says it
    value, lower, upper : estimate with its 95 % interval, in `unit`
    standard_error : of the estimate
    n : measurements behind it
    """

    name: str
    unit: str
    told: float | None
    value: float
    lower: float
    upper: float
    standard_error: float
    n: int

    @property
    def is_apart_from_told(self) -> bool:
        """Whether the whole interval lies to one side of what the vehicle was told."""
        return self.told is not None and not self.lower <= self.told <= self.upper


@dataclass(frozen=True)
class Effect:
    """What one tuner found on one flight.

    Attributes
    ----------
    id : of the tuner, as `drag`
    estimates : in the order of the axes; empty where the flight does not tell
    refusal : why it does not tell and what to fly instead, in words; empty where it does
    figures : what the estimate rests on: excitation, share of the variance that is explained …; names end in the unit
    """

    id: str
    estimates: tuple[Estimate, ...] = ()
    refusal: str = ""
    figures: Mapping[str, float] = field(default_factory=dict, hash=False)

    def values(self) -> dict[str, float]:
        """Values by name."""
        return {one.name: one.value for one in self.estimates}

    def document(self) -> dict[str, Any]:
        """As JSON holds it."""
        return asdict(self)
