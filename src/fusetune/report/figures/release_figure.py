"""One flight as the estimators of several releases see it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fusetune.analyze.releases.compared_releases import ReleaseComparison
from fusetune.px4.aid_sources import AID_SOURCES, AXES
from fusetune.report.figures.drawing import empty_figure, label_sets, new_figure, set_colours

_ROW, _HEAD, _WIDTH = 0.17, 1.0, 7.0
_MARKERS = "osD^vP"


def draw_releases(found: ReleaseComparison) -> Figure:
    """Innovations of each source against those of the release that flew, rejected samples, and events."""
    keys = found.keys
    if not keys:
        return empty_figure("No release had samples in the air that could be compared.")
    names = [source if AID_SOURCES[source].axes == 1 else f"{source} {AXES[axis]}" for source, axis in keys]
    events = _events(found)
    figure = new_figure(_WIDTH, _HEAD + _ROW * max(len(names), 2 * len(events)))
    sizes, rejected, counts = figure.subplots(1, 3, width_ratios=(3.0, 1.6, 2.0))
    colours = set_colours([one.release for one in found.replays], found.base)
    for number, replay in enumerate(found.replays):
        look = {"color": colours[replay.release], "marker": _MARKERS[number % len(_MARKERS)], "linestyle": "none"}
        axes_of = [replay.axis(*key) for key in keys]
        # what the release compared with has no samples of has nothing to be held against
        own = 0.0 if replay.release == found.base else np.nan
        changes = [own if one is None or one.rms_change is None else 100.0 * one.rms_change for one in axes_of]
        shares = [np.nan if one is None else 100.0 * one.rejected for one in axes_of]
        places = np.arange(len(keys)) + _aside(number, len(found.replays))
        sizes.plot(changes, places, label=replay.release, markersize=4.0, **look)
        rejected.plot(shares, places, markersize=4.0, **look)
        counts.barh(
            np.arange(len(events)) + _aside(number, len(found.replays)),
            [counted[number] for counted in events.values()],
            height=0.7 / len(found.replays),
            color=colours[replay.release],
        )
    _label(sizes, names, f"RMS of the innovations against {found.base}'s [%]")
    sizes.axvline(0.0, color="#888888", linewidth=0.7)
    _label(rejected, names, "rejected [%]")
    rejected.tick_params(labelleft=False)
    _label(counts, list(events), "times, or s")
    counts.set_xlim(0.0, max(1.0, *(max(counted) for counted in events.values())))
    figure.legend(*sizes.get_legend_handles_labels(), loc="outside upper center", ncols=len(found.replays))
    return figure


def _aside(number: int, of: int) -> float:
    """How far the mark of a release stands from the middle of its row, so that none covers another."""
    return 0.7 * ((number + 0.5) / of - 0.5)


def _events(found: ReleaseComparison) -> dict[str, list[float]]:
    kinds = dict.fromkeys(kind for one in found.replays for kind in one.events.resets)
    told: dict[str, list[float]] = {
        f"resets of {kind.replace('_', ' ')}": [float(one.events.resets.get(kind, 0)) for one in found.replays]
        for kind in kinds
    }
    told["sources lost"] = [float(one.events.total_timeouts) for one in found.replays]
    told["unaided, s"] = [one.events.dead_reckoning_s for one in found.replays]
    return told


def _label(axes: Axes, names: list[str], about: str) -> None:
    label_sets(axes, names)
    axes.set_xlabel(about)
