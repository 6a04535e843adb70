"""How the decision is made; docs/decision.md argues for it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from fusetune.analyze.flight.manoeuvre_classes import FLOWN_CLASSES
from fusetune.px4.aid_sources import AXES, MEASURED_SOURCES, WITHHOLDABLE
from fusetune.settings.declaration import setting


def _withheld_sources() -> tuple[str, ...]:
    """Sources that are predicted without their sensor, whole ("gnss_pos") and by axis ("gnss_vel.z")."""
    sources = tuple(source for sources in WITHHOLDABLE.values() for source in sources)
    return (*sources, *(f"{source}.{axis}" for source in sources for axis in AXES[: MEASURED_SOURCES[source].axes]))


@dataclass(frozen=True)
class DecisionSettings:
    """How the choice is made.

    Section `decision` of the configuration.
    """

    sources: Mapping[str, float] = setting(
        {"gnss_vel": 1.0, "ev_vel": 1.0, "ev_pos": 1.0, "optical_flow": 1.0},
        "aid sources whose predictions one step ahead count, with their weights; those that a flight lacks are left "
        "out",
        low=0,
        high=1_000_000,
        choices=tuple(sorted(MEASURED_SOURCES)),
        at_least=1,
    )
    withheld_sources: Mapping[str, float] = setting(
        {"gnss_pos": 3.0, "gnss_vel.z": 1.0},
        "aid sources, whole or one axis of them (`gnss_vel.z`), that are predicted while their sensor is withheld, "
        "with their weights",
        low=0,
        high=1_000_000,
        choices=_withheld_sources(),
        at_least=1,
    )
    aided_weight: float = setting(1.0, "weight of the predictions one step ahead", low=0, high=100)
    unaided_weight: float = setting(1.0, "weight of the predictions without the sensor", low=0, high=100)
    smoothed_axes: Mapping[str, float] = setting(
        {"x": 1.0, "y": 1.0, "z": 1.0},
        "axes of the velocity (north, east, down) that is compared with the smoothed one, with their weights",
        low=0,
        high=1_000_000,
        choices=AXES,
        at_least=1,
    )
    smoothed_weight: float = setting(
        1.0,
        "weight of the difference to the smoothed velocity, as far as the predictions one step ahead are not trusted",
        low=0,
        high=100,
    )
    distrust_white_share: float = setting(
        0.6, "a source whose error is less white has no say in the predictions one step ahead", low=0, high=1
    )
    trust_white_share: float = setting(0.9, "a source whose error is whiter has its full weight there", low=0, high=1)
    only_classes: tuple[str, ...] = setting(
        (),
        "manoeuvre classes that alone count, of each flight; empty: the whole flight",
        choices=FLOWN_CLASSES,
    )
    multiplicity: Literal["sign_flips", "holm", "none"] = setting(
        "sign_flips",
        "allowance for the best of many sets being lucky: a test that flips the signs of flights, or Holm's correction",
    )
    equivalence_percent: float = setting(
        1.0,
        "a set within one standard error of the best, and whose errors are at most so much larger, is preferred if it "
        "is nearer to the present parameters",
        unit="%",
        low=0,
        high=100,
    )
    smallest_gain_percent: float = setting(
        1.0,
        "a change is made only for a set whose errors are smaller by more than this beyond doubt: its whole interval "
        "lies beyond it",
        unit="%",
        low=0,
        high=50,
    )
    lowest_grade: Literal["A", "B", "C", "D"] = setting(
        "C",
        "flights whose replay has a lower trust grade do not count; one that has nothing to be compared with does",
    )
    confidence: float = setting(0.95, "level of the interval that must exclude zero for a change", low=0.5, high=0.999)
    draws: int = setting(4000, "draws of the paired bootstrap", low=200, high=200_000)
    minimum_flights: int = setting(5, "with fewer flights the decision is called exploratory", low=1, high=1000)
    noise_factor: float = setting(
        2.0,
        "the noise of a source is told of where PX4 is told beyond doubt one so many times too large or too small",
        above=1,
        high=100,
    )
    seed: int = 0
    """Of the bootstrap; the configuration has it beside the sections."""

    def trust(self, white_share: float) -> float:
        """Weight of a source, 0 … 1, whose error is as white as this."""
        span = self.trust_white_share - self.distrust_white_share
        if span <= 0.0:
            return float(white_share >= self.trust_white_share)
        return min(max((white_share - self.distrust_white_share) / span, 0.0), 1.0)

    @property
    def confidence_of_a_change(self) -> float:
        """Level of the intervals by which a change is decided: two kinds of proof share the error."""
        return 0.5 + 0.5 * self.confidence

    @property
    def smallest_gain(self) -> float:
        """Difference of scores, nat, below which a gain matters (0 or negative)."""
        return math.log1p(-0.01 * self.smallest_gain_percent)

    @property
    def main_source(self) -> str:
        """The source that the figures beside the score are shown of."""
        return max(self.sources, key=lambda source: self.sources[source])
