"""Which mission a flight flew, as a pilot reads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    # pages need the words alone, and not what compares a log with missions
    from fusetune.analyze.conformance.conformed_logs import ConformedLog

Document = Mapping[str, Any]

TRACK_WORDS = {
    "smoothed": "the smoothed track of the whole flight",
    "estimate": "the vehicle's own estimate",
    "gnss": "the receiver's positions",
    "local": "a local estimate without a place on earth",
}


def log_lines(one: ConformedLog) -> Iterator[str]:
    """What was found on one log, line by line."""
    if one.error is not None:
        yield f"{one.log}: {one.error.reason}. {one.error.remedy}."
        return
    found = one.found or {}
    if found["why_not_compared"]:
        yield f"{one.log}: not compared with any mission: {found['why_not_compared']}"
        return
    yield f"{one.log}: by {TRACK_WORDS[found['track']]}"
    for mission in found["missions"]:
        yield f"  {mission['mission']}: {mission['verdict']}: {mission['why']}"
        if mission["verdict"] != "not this mission":
            yield from (f"    {line}" for line in _detail_lines(mission, found["start_us"]))


def _detail_lines(mission: Document, start_us: int) -> Iterator[str]:
    for waypoint in mission["waypoints"]:
        yield waypoint_words(waypoint, start_us)
    for leg in mission["legs"]:
        if leg["figures"] is not None:
            yield leg_words(leg)


def waypoint_words(waypoint: Document, start_us: int) -> str:
    """A waypoint in a line."""
    how = "passed" if waypoint["in_order"] else "passed out of order" if waypoint["passed"] else "missed"
    when = "" if waypoint["time_us"] is None else f" after {(waypoint['time_us'] - start_us) * 1e-6:.1f} s"
    distance = f"{waypoint['miss_m']:.1f} m beside, {waypoint['height_error_m']:+.1f} m in height"
    return f"waypoint {waypoint['waypoint'] + 1}: {how}{when}, {distance}"


def leg_name(leg: Document) -> str:
    """A leg by where it leads."""
    if leg["kind"] == "travel":
        return f"to waypoint {leg['waypoint'] + 1}"
    return {"takeoff": "take-off", "return": "return", "descent": "descent"}[leg["kind"]]


def leg_words(leg: Document) -> str:
    """A leg in a line."""
    figures = leg["figures"]
    return (
        f"{leg_name(leg)}: beside the leg {figures['cross_track_mean']:.2f} m in the mean, "
        f"{figures['cross_track_95']:.2f} m at 95 %, {figures['cross_track_max']:.2f} m at most; height "
        f"{figures['height_error_mean']:+.2f} m; {figures['speed']:.1f} m/s of {leg['planned_speed_m_s']:.1f} m/s"
    )
