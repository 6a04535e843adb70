"""What was replayed and how it went: the document that stands beside the tables of a replay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.ekf2.replay.results import ReplaySummary


@dataclass(frozen=True)
class ReplayIdentity:
    """What was replayed, and whose estimator did it."""

    set: str
    overrides: Mapping[str, float]
    params: Mapping[str, float]
    version: str
    inputs: Mapping[str, Any] | None = None
    """How the replay started and what was reconstructed for it; stands in the JSON file."""


def summary_document(identity: ReplayIdentity, result: ReplaySummary) -> dict[str, Any]:
    """What a replay says of itself, as JSON can hold it."""
    status, reason = ("diverged", "a state or variance is no finite number") if result.diverged else ("ok", "")
    if not result.updates:
        status, reason = "not_started", _why_not_started(result)
    origin = None
    if result.origin is not None:
        origin = dict(zip(("latitude_deg", "longitude_deg", "altitude_m"), result.origin, strict=True))
    return {
        "version": identity.version,
        "set": identity.set,
        "overrides": dict(identity.overrides),
        "status": status,
        "reason": reason,
        "n_imu": result.imu_samples,
        "n_updates": result.updates,
        "mode": result.mode,
        **(identity.inputs or {}),
        "resets": dict(result.resets),
        "filter_fault_flags_max": result.filter_fault_flags_max,
        "origin": origin,
        "params": dict(identity.params),
    }


def _why_not_started(result: ReplaySummary) -> str:
    if result.levelled:
        return "the IMU samples end before the fusion time horizon has moved"
    return "the filter never found the vehicle still enough to take its tilt"
