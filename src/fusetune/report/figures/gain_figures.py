"""What a search is worth: on the flights that it saw, and on those that were kept aside from it."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fusetune.report.figures.drawing import CHOSEN_COLOUR, PRESENT_COLOUR, empty_figure, minus, new_figure
from fusetune.report.search_results import SearchResults

NOTHING_ASIDE = "With a single flight nothing can be kept aside: nothing shows what is luck."

_WORSE_COLOUR = "#D55E00"
_LUCK_COLOUR = "#E69F00"
_ROW = 0.34
_LONGEST_NAME = 34


def shrinkage_figure(results: SearchResults) -> Figure:
    """A row for all parts together and for each: gain on the flights that the search saw, and on those kept aside."""
    search = results.search
    mean = _mean([one["gain_in_search_percent"] for one in results.parts])
    rows = [("mean of all parts", mean, search["gain_kept_aside_percent"])]
    rows += [
        (_part_name(number, one["kept_aside"]), one["gain_in_search_percent"], one["gain_kept_aside_percent"])
        for number, one in enumerate(results.parts, 1)
    ]
    shown = [(name, seen, aside) for name, seen, aside in rows if seen is not None and aside is not None]
    if not shown:
        return empty_figure(NOTHING_ASIDE)
    figure = new_figure(7.2, 1.35 + _ROW * len(shown))
    axes = figure.add_subplot()
    for place, (_, seen, aside) in enumerate(shown):
        is_first = place == 0
        axes.plot(
            [seen, aside], [place, place], color=_LUCK_COLOUR if aside < seen else CHOSEN_COLOUR,
            linewidth=5.0 if is_first else 2.5, alpha=0.55, solid_capstyle="butt", zorder=2,
            label="luck: what is lost on new flights" if is_first and aside < seen else None,
        )  # fmt: skip
        size = 8.5 if is_first else 6.0
        axes.plot(
            seen, place, "o", color="white", markeredgecolor="#444444", markersize=size, zorder=3, linestyle="none",
            label="on the flights that the search saw" if is_first else None,
        )  # fmt: skip
        axes.plot(
            aside, place, "o", color=CHOSEN_COLOUR, markersize=size, zorder=4, linestyle="none",
            label="on the flights kept aside from it" if is_first else None,
        )  # fmt: skip
    if len(shown) > 1:
        axes.axhline(0.5, color="#bbbbbb", linewidth=0.7)
    _rows(axes, [name for name, _, _ in shown])
    _gain_axis(axes, [value for _, seen, aside in shown for value in (seen, aside)])
    figure.suptitle(_shrinkage_title(shown[0][1], shown[0][2]), fontsize=9.5, x=0.01, ha="left")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def _shrinkage_title(seen: float, aside: float) -> str:
    """The answer first: how much of the gain was luck."""
    told = f"gain {_signed(seen)} % on the flights searched on, {_signed(aside)} % on flights kept aside"
    if seen <= 0.0:
        return f"The search found no gain: {told}"
    if aside <= 0.0:
        return f"All of the gain was luck: {told}"
    if aside >= seen:
        return f"No luck in it: {told}"
    return f"{100.0 * (1.0 - aside / seen):.0f} % of the gain was luck: {told}"


def kept_aside_figure(results: SearchResults) -> Figure:
    """A bar for each flight: what was found without it is worth there; the expected gain with its interval behind."""
    gains = {name: gain for name, gain in results.search["kept_aside"].items() if gain is not None}
    if not gains:
        return empty_figure(NOTHING_ASIDE)
    figure = new_figure(7.2, 1.35 + 0.8 * _ROW * len(gains))
    axes = figure.add_subplot()
    values = list(gains.values())
    expected = results.search["expected_gain"]
    ends: list[float] = []
    if expected is not None:
        lower, upper = expected["lower_percent"], expected["upper_percent"]
        if lower is not None and upper is not None:
            ends = [lower, upper]
            axes.axvspan(lower, upper, color=CHOSEN_COLOUR, alpha=0.12, linewidth=0, label="95 % interval")
        axes.axvline(
            expected["percent"],
            color=PRESENT_COLOUR,
            linewidth=1.6,
            zorder=3,
            label="expected on as many flights again",
        )
    colours = [CHOSEN_COLOUR if value >= 0.0 else _WORSE_COLOUR for value in values]
    axes.barh(range(len(values)), values, height=0.62, color=colours, alpha=0.85, zorder=2)
    _rows(axes, [_short(name) for name in gains])
    _gain_axis(axes, _within_reach(values, ends))
    for place, value in enumerate(values):
        axes.annotate(
            _signed(value), (value, place), (4 if value >= 0.0 else -4, 0), textcoords="offset points", fontsize=7.5,
            ha="left" if value >= 0.0 else "right", va="center", color="#333333", zorder=4,
        )  # fmt: skip
    figure.suptitle(_kept_aside_title(values, expected), fontsize=9.5, x=0.01, ha="left")
    if expected is not None:
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def _kept_aside_title(values: Sequence[float], expected: dict[str, float | None] | None) -> str:
    better = sum(value > 0.0 for value in values)
    text = f"Better on {better} of {len(values)} flights that the search did not see"
    if expected is None:
        return text
    lower, upper = expected["lower_percent"], expected["upper_percent"]
    span = f" ({_signed(lower)} to {_signed(upper)})" if lower is not None and upper is not None else ""
    percent = expected["percent"]
    return f"{text}; expect {_signed(percent)} %{span}" if percent is not None else text


def _within_reach(values: Sequence[float], ends: Sequence[float]) -> list[float]:
    """An interval that is much wider than all bars must not squeeze them: it runs out of the picture."""
    reach = 2.0 * max(map(abs, values), default=1.0)
    return [*values, *(min(max(end, -reach), reach) for end in ends)]


def _gain_axis(axes: Axes, values: Sequence[float]) -> None:
    low, high = min(0.0, *values), max(0.0, *values)
    margin = 0.09 * max(high - low, 1.0)
    axes.set_xlim(low - margin, high + margin)
    axes.axvline(0.0, color="#444444", linewidth=0.9, zorder=1)
    axes.set_xlabel("prediction errors smaller by [%]")
    axes.xaxis.set_major_formatter(lambda value, _: minus(f"{value:+.4g}") if value else "0")


def _rows(axes: Axes, names: Sequence[str]) -> None:
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.45, -0.55)
    axes.grid(visible=False, axis="y")


def _part_name(number: int, flights: Sequence[str]) -> str:
    return f"part {number} kept aside ({len(flights)} flight{'s' if len(flights) != 1 else ''})"


def _short(name: str) -> str:
    """The end of a name tells flights apart."""
    return name if len(name) <= _LONGEST_NAME else f"…{name[1 - _LONGEST_NAME :]}"


def _mean(values: Sequence[float | None]) -> float | None:
    known = [one for one in values if one is not None]
    return sum(known) / len(known) if known else None


def _signed(value: float) -> str:
    return minus(f"{value:+.1f}")
