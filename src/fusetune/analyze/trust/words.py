"""What limits a trust grade, in words: the figures that have it, and those that could not be compared."""

from __future__ import annotations

from collections.abc import Sequence

from fusetune.analyze.trust.as_flown_figures import AsFlownFigures
from fusetune.analyze.trust.settings import TrustSettings
from fusetune.finding import Finding, Severity
from fusetune.px4.flight import Flight
from fusetune.save.replayed_release import ReplayedRelease

FIGURE_NAMES = {
    "innovation_factor": "the size of the innovations",
    "velocity_m_s": "horizontal velocity",
    "heading_deg": "heading",
    "height_m": "height",
    "vertical_velocity_m_s": "vertical velocity",
    "height_resets": "resets of height",
    "flags_equal": "flags",
    "height_flags_equal": "the sources of height",
}
GRADES = "ABCD"
SEVERITIES: dict[str, Severity] = {"B": "note", "C": "warning", "D": "fail"}
"""Of what gives a flight such a grade; an A is given by nothing."""
_UNITS = {"velocity_m_s": "m/s", "heading_deg": "°", "height_m": "m", "vertical_velocity_m_s": "m/s"}


def limits_of_grade(
    figures: AsFlownFigures, names: Sequence[str], grade: str, settings: TrustSettings
) -> list[Finding]:
    """How the replay departs from the vehicle in the figures that have some grade; `threshold` is that of the next."""
    better = GRADES.index(grade) - 1
    return [
        Finding(
            name,
            SEVERITIES[grade],
            found,
            figure=getattr(figures, name),
            threshold=getattr(settings, name)[better],
            unit=_UNITS.get(name, ""),
        )
        for name, found in _limits_in_words(figures, names)
    ]


def _limits_in_words(figures: AsFlownFigures, names: Sequence[str]) -> list[tuple[str, str]]:
    words = {
        "height_resets": _resets,
        "height_flags_equal": lambda one: (
            f"the replay takes its height from the vehicle's sources in only {one.height_flags_equal:.0%} of the time"
        ),
        "innovation_factor": _innovations,
        "velocity_m_s": lambda one: f"horizontal velocity differs by {one.velocity_m_s:.3g} m/s",
        "heading_deg": lambda one: f"heading differs by {one.heading_deg:.3g}°",
        "height_m": lambda one: f"height differs by {one.height_m:.3g} m",
        "vertical_velocity_m_s": lambda one: f"vertical velocity differs by {one.vertical_velocity_m_s:.3g} m/s",
        "flags_equal": lambda one: f"the flags agree in {one.flags_equal:.0%} of the time",
    }
    return [(name, words[name](figures)) for name in words if name in names]


def _resets(figures: AsFlownFigures) -> str:
    return " and ".join(
        f"the replay resets its {what} {_times(ours)} where the vehicle did so {_times(theirs)}"
        for what, (ours, theirs) in figures.resets.items()
        if abs(ours - theirs) == figures.height_resets
    )


def _innovations(figures: AsFlownFigures) -> str:
    def factor(ratio: float) -> float:
        return max(ratio, 1.0 / max(ratio, 1e-9))

    group, ratio = max(figures.innovation_ratio.items(), key=lambda item: factor(item[1]))
    return f"innovations of {group.replace('_', ' ')} are {ratio:.2g} times the vehicle's"


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def not_compared(names: Sequence[str]) -> Finding:
    """That the log does not let some figures be compared."""
    words = [FIGURE_NAMES[name] for name in names]
    listed = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
    return Finding("not_compared", "warning", f"the log does not let {listed} be compared", figure=float(len(names)))


def other_release(flight: Flight, replayed: ReplayedRelease) -> str:
    """That the vehicle flew another release than the one that is replayed; empty where it did not, or is not known."""
    if replayed.flown.release is None or replayed.flew:
        return ""
    flown = flight.release_name
    if flown == "unknown" or not flown.startswith(replayed.flown.name):
        flown = replayed.flown.name
    return f"the vehicle flew {flown}, the replay behaves like {replayed.name}"
