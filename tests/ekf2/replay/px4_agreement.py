"""When a replay counts as that of PX4: the same demands on golden, made and real flights, each within its limits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fusetune.analyze.replaying.replay_log import replay_log
from fusetune.analyze.trust.fidelity import AxisFidelity, ReplayFidelity, compare_folders


@dataclass(frozen=True)
class Limits:
    """The largest figures of `fusetune.analyze.trust.fidelity` that count as agreement.

    What remains of a right estimator is PX4's single precision, see docs/fidelity.md. Decisions, resets and samples
    must be the same in any case.
    """

    relative_rms: float
    """Of any source and axis."""
    variance: float
    velocity_rms: float
    """m/s"""
    attitude_rms_deg: float
    gyro_bias_rms: float = float("inf")
    """rad/s"""
    median_relative_rms: float = float("inf")
    flags_equal: float = 0.999
    """Least share of time."""


def assert_replay_agrees(log: Path, reference: Path, replays: Path, limits: Limits) -> list[ReplayFidelity]:
    """Replay every set of a reference folder and demand that it is PX4's; `replays` takes the files."""
    sets = replay_log(log, reference, replays)
    found = compare_folders(reference, replays)
    assert [one.set for one in found] == sets
    told = [f"{reference.name} {one.set}: {departure}" for one in found for departure in departures(one, limits)]
    assert not told, "\n".join(told)
    return found


def departures(found: ReplayFidelity, limits: Limits) -> list[str]:
    """What of a replay is not PX4's, in words; empty where all is."""
    figures = {
        "samples missing": (found.missing, 0.0),
        "velocity": (found.velocity_rms, limits.velocity_rms),
        "attitude": (found.attitude_rms_deg, limits.attitude_rms_deg),
        "gyro bias": (found.gyro_bias_rms, limits.gyro_bias_rms),
    }
    if found.axes:
        figures["median of the axes"] = (found.median_relative_rms, limits.median_relative_rms)
    for axis in found.axes:
        figures |= _of_axis(axis, limits)
    # what is no number is no agreement
    told = [f"{name}: {figure:.3g} > {limit:.3g}" for name, (figure, limit) in figures.items() if not figure <= limit]
    if not found.flags_equal >= limits.flags_equal:
        told.append(f"flags equal in {found.flags_equal:.3%} of the time: {', '.join(found.differing_flags)}")
    if not found.resets_equal:
        told.append("resets differ")
    return told


def _of_axis(axis: AxisFidelity, limits: Limits) -> dict[str, tuple[float, float]]:
    name = f"{axis.source}[{axis.axis}]"
    return {
        f"{name} innovation": (axis.relative_rms, limits.relative_rms),
        f"{name} variance": (axis.variance_difference, limits.variance),
        f"{name} fused unequal": (1.0 - axis.fused_equal, 0.0),
        f"{name} rejected unequal": (1.0 - axis.rejected_equal, 0.0),
    }
