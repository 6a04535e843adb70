"""A search: which parameters, how far, how many sets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fusetune.design.tunable_parameters import DELAY_LIMIT
from fusetune.settings.declaration import setting

FEWEST_EVALUATIONS = 24

SEARCHED = (
    "EKF2_GPS_DELAY",
    "EKF2_GPS_POS_X",
    "EKF2_GPS_POS_Y",
    "EKF2_GPS_POS_Z",
    "EKF2_GPS_V_NOISE",
    "EKF2_ACC_NOISE",
    "EKF2_GYR_NOISE",
    "EKF2_BARO_NOISE",
    "EKF2_MAG_NOISE",
    "EKF2_EV_DELAY",
    "EKF2_EVP_NOISE",
    "EKF2_EVV_NOISE",
    "EKF2_OF_DELAY",
    "EKF2_OF_N_MIN",
    "EKF2_RNG_NOISE",
)
"""What is searched by default, as far as the flights exercise it: what flights of simulated vehicles could tell
(docs/search.md), and the like of other sensors."""


@dataclass(frozen=True)
class SearchSettings:
    """A search.

    Section `search` of a study file.
    """

    parameters: tuple[str, ...] = setting(
        (), "parameters that are searched; empty: those of which the flights can tell, see docs/search.md"
    )
    bounds: Mapping[str, tuple[float, ...]] = setting(
        {}, "lowest and highest value of a parameter; by default within `ratio` of the present one, inside its range"
    )
    ratio: float = setting(8.0, "by how much a value may be larger or smaller than the present one", above=1, high=1000)
    evaluations: int = setting(
        400,
        "parameter sets that are tried in all: by the search on all flights, and by those with a part kept aside",
        low=FEWEST_EVALUATIONS,
        high=5000,
    )
    folds: int = setting(4, "parts of the flights, in order of time, each of which is kept aside once", low=2, high=50)
    putting_back_percent: float = setting(
        1.0,
        "a parameter keeps its present value where that makes errors larger by less than this, or than one "
        "standard error",
        unit="%",
        low=0,
        high=50,
    )
    seed: int = setting(1, "what chance follows from", low=0, high=2**31 - 1)

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the parameters that are searched."""
        return self.parameters or SEARCHED

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of all that a set of the search may change: what goes along with a delay, too."""
        return (*self.searched, DELAY_LIMIT)
