"""Which release's estimator replays a flight: the one that flew, or the nearest to it that is modelled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fusetune.ekf2.releases.behaviours import MODELLED
from fusetune.px4.flight import Flight
from fusetune.px4.flown_release import FlownRelease, flown_release
from fusetune.px4.releases import (
    AUTO,
    BASELINE,
    ESTIMATORS,
    Release,
    deviation_of,
    estimator_name,
    number_of_name,
)


@dataclass(frozen=True)
class ReplayedRelease:
    """The release whose estimator replays a flight.

    Attributes
    ----------
    name : such as "v1.16" or "main"
    flown : the release that flew
    reason : why it is another one than that; empty where it is not
    asked : what was asked for: "auto", or a release
    """

    name: str
    flown: FlownRelease
    reason: str
    asked: str

    @property
    def release(self) -> Release:
        """Its number, for what depends on the release beside the estimator."""
        return number_of_name(self.name)

    @property
    def flew(self) -> bool:
        """Whether it is the release that flew."""
        return self.name == self.flown.name

    def document(self) -> dict[str, Any]:
        """As it stands in `metadata.json` and in the summary of a replay."""
        return {
            "flown": self.flown.name,
            "evidence": self.flown.evidence,
            "own_parameters": list(self.flown.own_parameters),
            "replayed": self.name,
            "reason": self.reason,
        }


def replayed_release(flight: Flight, asked: str = AUTO, modelled: Sequence[str] = MODELLED) -> ReplayedRelease:
    """Choose the release whose estimator replays a flight.

    Parameters
    ----------
    asked : "auto" for the release that flew, or the name of one
    modelled : releases whose estimators can be replayed; of others the nearest of these does it, of two equally near
        ones the newer
    """
    flown = flown_release(flight)
    wanted = flown.release if asked == AUTO else number_of_name(asked)
    if wanted is None:
        name = estimator_name(BASELINE)
        return ReplayedRelease(name, flown, flown.evidence, asked)
    name = nearest_of(wanted, modelled)
    why = [] if asked == AUTO or flown.name == asked else [f"{asked} is asked for"]
    if name != estimator_name(wanted):
        beyond = number_of_name(ESTIMATORS[0]) > wanted[:2]
        why.append(
            f"{estimator_name(wanted)} is {'older than all releases' if beyond else 'none of the releases'} whose "
            f"estimator is modelled, and {name} is the nearest of those: {deviation_of(wanted, number_of_name(name))}"
        )
    return ReplayedRelease(name, flown, "; ".join(why), asked)


def nearest_of(release: Release, modelled: Sequence[str] = MODELLED) -> str:
    """The name of the modelled release that is nearest to a release; of two equally near ones the newer."""
    numbers = {name: number_of_name(name) for name in modelled}
    last = max(numbers.values())
    wanted = min(release[:2], last)
    return min(modelled, key=lambda name: (abs(numbers[name][1] - wanted[1]), -numbers[name][1]))
