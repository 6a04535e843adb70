"""The figures of the trust grade in words."""

from __future__ import annotations

from collections.abc import Sequence

from fusetune.analyze.trust.as_flown_figures import AsFlownFigures

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


def limits_in_words(figures: AsFlownFigures, names: Sequence[str]) -> list[str]:
    """How the replay departs from the vehicle in some of the figures, a clause each."""
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
    return [words[name](figures) for name in words if name in names]


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


def not_compared_in_words(names: Sequence[str]) -> str:
    """That the log does not let some figures be compared."""
    words = [FIGURE_NAMES[name] for name in names]
    listed = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
    return f"the log does not let {listed} be compared"
