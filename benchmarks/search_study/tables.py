"""The tables of the study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from .emulated_studies import Outcome
from .found_sets import JudgedWorld
from .true_figures import FIGURES

MOST_BEHIND, MOST_HARM_PERCENT = 1.05, 3.0
JUDGED = [FIGURES.index(name) for name in ("velocity", "drift")]
"""A found set should be no farther behind the oracle's in these, and no worse than the present set in any."""

NEAR_MS, NEAR_M, NEAR_RATIO = 10.0, 0.1, 1.5
"""How near to the right value a delay, each axis of a lever arm, and a noise are found."""


def found_table(worlds: Sequence[JudgedWorld]) -> str:
    """Found sets against the oracle's and the present, on fresh flights."""
    rows = [
        f"| {one.name} | {_values(one.found.changed, one.found.values)} | {_changes(one.change)} "
        f"| {_changes(one.best_change)} | {'/'.join(f'{one.ratio[at]:.2f}' for at in JUDGED)} | {_remark(one)} |"
        for one in worlds
    ]
    head = (
        "| world | found | true change on fresh flights, velocity/attitude/position/drift % "
        "| of the oracle's set | found over oracle's, velocity/drift | |"
    )
    return "\n".join([head, "| --- | --- | --- | --- | --- | --- |", *rows])


def _remark(one: JudgedWorld) -> str:
    behind = [FIGURES[at] for at in JUDGED if one.ratio[at] > MOST_BEHIND]
    harmed = [name for name, change in zip(FIGURES, one.change, strict=True) if change > MOST_HARM_PERCENT]
    said = [f"behind in {', '.join(behind)}"] if behind else []
    return "; ".join(said + ([f"worse in {', '.join(harmed)}"] if harmed else []))


def wrong_table(worlds: Sequence[JudgedWorld]) -> str:
    """What vehicles were told wrong, and what was found."""
    rows = [
        f"| {one.name} | {name} | {one.present[name]:g} | {right:.3g} | {one.found.values[name]:.3g} "
        f"| {'yes' if is_near(name, one.found.values[name], right) else 'no'} |"
        for one in worlds
        for name, right in one.right.items()
    ]
    return "\n".join(
        ["| world | parameter | told | right | found | near |", "| --- | --- | --- | --- | --- | --- |", *rows]
    )


def is_near(name: str, found: float, right: float) -> bool:
    """Whether a found value is as near to the right one as is asked for."""
    if name.endswith("_DELAY"):
        return abs(found - right) <= NEAR_MS
    if "_POS_" in name:
        return abs(found - right) <= NEAR_M
    return 1.0 / NEAR_RATIO <= found / right <= NEAR_RATIO


def emulated_table(outcomes: Mapping[tuple[str, str, int], Sequence[Outcome]]) -> str:
    """Searches on emulated flights, by world, kind and number of flights."""
    rows = [
        f"| {world} | {kind} | {flights} | {len(found)} | {' | '.join(_shares(found))} | {' | '.join(_gains(found))} |"
        for (world, kind, flights), found in outcomes.items()
    ]
    head = (
        "| world | present set | flights | searches | change recommended | interval holds the gain over all flights "
        "| on the fresh ones | widened for so few | gain in search % | expected % | on fresh flights % |"
    )
    return "\n".join([head, "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |", *rows])


def _shares(outcomes: Sequence[Outcome]) -> list[str]:
    """Of searches after which a change is recommended; of those that found anything, whose interval holds the gain over
    all flights of the world, and on the fresh ones, as it is and widened for so few."""
    found = [one for one in outcomes if one.changed]
    told = [
        [one.changes for one in outcomes],
        [one.covers(one.world) for one in found],
        [one.covers(one.fresh) for one in found],
        [one.covers(one.fresh, one.fresh_flights) for one in found],
    ]
    return [f"{100.0 * float(np.mean(one)):.1f} %" if one else "" for one in told]


def _gains(outcomes: Sequence[Outcome]) -> list[str]:
    """Mean gains in the search, as expected, and on fresh flights, %."""
    told = np.array([(one.searched, one.expected, one.fresh) for one in outcomes])
    return [f"{one:.1f}" for one in 100.0 * (1.0 - np.exp(told.mean(axis=0)))]


def _values(names: Sequence[str], values: Mapping[str, float]) -> str:
    return ", ".join(f"{name.removeprefix('EKF2_')} {values[name]:.3g}" for name in names) or "nothing"


def _changes(change: npt.NDArray[np.float64]) -> str:
    return "/".join(f"{one:+.0f}" for one in change)
