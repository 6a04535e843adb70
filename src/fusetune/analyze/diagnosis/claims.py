"""What the estimator is told of noises and limits, against what sensors do and what PX4 takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterMetadata, as_float32

FAR, NEAR, REJECTED_FROM = 3.7, 3.3, 0.1
"""A claimed noise is far off from this factor on, as near to four as its estimate is sure: within it PX4's defaults
serve sensors of many kinds. One that is too small shows earlier, where the filter refuses measurements for it."""
NOISES: Mapping[str, str] = {
    "gnss_vel": "EKF2_GPS_V_NOISE",
    "gnss_pos": "EKF2_GPS_P_NOISE",
    "baro_hgt": "EKF2_BARO_NOISE",
    "mag": "EKF2_MAG_NOISE",
}
LIMITED = ("_NOISE", "_GATE", "_LIM", "_NSD")
"""Endings of parameters that people tune and that end at a bound only when something else is wrong."""


@dataclass(frozen=True)
class NoiseClaim:
    """One source.

    Attributes
    ----------
    parameter, told : that tells its noise, and what it says
    usual : its default in the release that flew
    measured : white noise of the readings, in the same unit
    effective : what the filter takes, with what the receiver reports where that is more
    rejected : share of the source's test ratios above 1
    """

    parameter: str
    told: float
    usual: float
    measured: float
    effective: float
    rejected: float = 0.0

    @property
    def ratio(self) -> float:
        """Claimed over measured noise; of one that claims more than the default only as far as it does."""
        return self.effective / max(self.measured, 1e-9)

    @property
    def too_large(self) -> bool:
        """Far more than the sensor does, and than PX4 claims for sensors it does not know."""
        return self.ratio > FAR and self.told >= FAR * self.usual * 0.99 and self.told > FAR * self.measured

    @property
    def too_small(self) -> bool:
        """Far less than the sensor does."""
        return self.measured > (FAR if self.rejected < REJECTED_FROM else NEAR) * self.effective


def noise_claims(
    parameters: Mapping[str, float],
    measured: Mapping[str, float],
    reported: Mapping[str, float],
    rejected: Mapping[str, float],
) -> dict[str, NoiseClaim]:
    """Claims by source.

    Parameters
    ----------
    measured : white noise of the readings of each source
    reported : what a receiver reports of its own noise
    rejected : share of the test ratios of each source above 1
    """
    found = {}
    for source, noise in measured.items():
        name = NOISES[source]
        told = parameters.get(name, np.nan)
        if not (np.isfinite(told) and np.isfinite(noise) and noise > 0.0):
            continue
        effective = max(told, reported.get(source, 0.0))
        found[source] = NoiseClaim(name, told, PARAMETERS[name].default, noise, effective, rejected.get(source, 0.0))
    return found


@dataclass(frozen=True)
class AtLimit:
    """A parameter at a bound of its range."""

    parameter: str
    value: float
    is_low: bool
    default: float


def at_limits(parameters: Mapping[str, float], release: tuple[int, int] | None) -> tuple[AtLimit, ...]:
    """Parameters that people tune and that stand at a bound which is no default, of the release that flew or
    another."""
    found = []
    for name, value in parameters.items():
        known = PARAMETERS.get(name)
        if known is None or not name.endswith(LIMITED) or value in _defaults(known, release):
            continue
        for bound, is_low in ((known.minimum, True), (known.maximum, False)):
            if bound is not None and np.isclose(value, bound, rtol=1e-5, atol=1e-9):
                found.append(AtLimit(name, value, is_low, known.default))
    return tuple(found)


def _defaults(known: ParameterMetadata, release: tuple[int, int] | None) -> set[float]:
    """Default now and in the release that flew, as PX4 stores them."""
    defaults = {known.default}
    if release is not None and known.exists_in(release):
        defaults.add(known.default_in(release))
    return defaults | {as_float32(one) for one in defaults}
