"""The tables of the study."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from .cases import HEALTHY, PAIRS
from .kinds import KINDS
from .verdicts import Verdict

NOTHING = "nothing"


def kinds_table() -> str:
    """What is injected, and from where on it is visible."""
    rows = ["| injected | magnitude | visible from | because |", "| --- | --- | --- | --- |"]
    rows += [f"| `{one.id}` | {one.magnitude} | {one.visible_from:g} | {one.why} |" for one in KINDS.values()]
    return "\n".join(rows)


def shares_table(verdicts: Sequence[Verdict]) -> str:
    """How often the right cause stands first, and among the first two, of each kind and of all."""
    rows = [
        "| injected | flights | first, of the visible | among the first two | named of those not visible |",
        "| --- | --- | --- | --- | --- |",
    ]
    by_kind = {kind: [one for one in verdicts if one.group == kind] for kind in KINDS}
    for kind, own in by_kind.items():
        if own:
            rows.append(f"| `{kind}` | {_shares(own)} |")
    rows.append(f"| **all** | {_shares([one for own in by_kind.values() for one in own])} |")
    return "\n".join(rows)


def _shares(own: Sequence[Verdict]) -> str:
    visible = [one for one in own if one.is_visible]
    faint = [one for one in own if not one.is_visible]
    cells = [str(len(own)), _counts([_place(one) == 0 for one in visible])]
    cells.append(_counts([_place(one) < 2 for one in visible]))
    cells.append(_counts([_place(one) < len(one.named) for one in faint]))
    return " | ".join(cells)


def _place(verdict: Verdict) -> int:
    """Where the injected cause stands; after all where it is not named."""
    ids = [one.id for one in verdict.named]
    return ids.index(verdict.injected[0]) if verdict.injected[0] in ids else max(len(ids), 2)


def _percent(holds: Sequence[bool]) -> str:
    return f"{100.0 * float(np.mean(holds)):.1f} %" if len(holds) else "–"


def _counts(holds: Sequence[bool]) -> str:
    """How many of how many, and the share."""
    return f"{sum(holds)} of {len(holds)} ({_percent(holds)})" if len(holds) else "–"


def confusion_table(verdicts: Sequence[Verdict]) -> str:
    """What is named first for what was injected, of visible faults."""
    rows = ["| injected | named first, and how often |", "| --- | --- |"]
    for kind in KINDS:
        own = [one for one in verdicts if one.group == kind and one.is_visible]
        if own:
            rows.append(f"| `{kind}` | {_counted([one.named[0].id if one.named else NOTHING for one in own])} |")
    return "\n".join(rows)


def _counted(names: Sequence[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in Counter(names).most_common())


def healthy_table(verdicts: Sequence[Verdict]) -> str:
    """False alarms."""
    own = [one for one in verdicts if one.group == HEALTHY]
    alarmed = [one for one in own if one.alarms]
    causes = _counted([cause.id for one in alarmed for cause in one.alarms]) or NOTHING
    rows = ["| healthy flights | with an alarm | share | causes named |", "| --- | --- | --- | --- |"]
    share = _percent([bool(one.alarms) for one in own])
    return "\n".join([*rows, f"| {len(own)} | {len(alarmed)} | {share} | {causes} |"])


def pairs_table(verdicts: Sequence[Verdict]) -> str:
    """Two faults at once."""
    own = [one for one in verdicts if one.group == PAIRS]
    named = [len({*one.injected} & {cause.id for cause in one.named}) for one in own]
    missed = _counted([kind for one in own for kind in one.injected if kind not in {c.id for c in one.named}])
    return "\n".join(
        [
            "| flights with two faults | both named | one named | missed |",
            "| --- | --- | --- | --- |",
            f"| {len(own)} | {_counts([count == 2 for count in named])} | {_counts([count == 1 for count in named])} "
            f"| {missed or NOTHING} |",
        ]
    )


def reliability_table(verdicts: Sequence[Verdict]) -> str:
    """How many diagnoses were right, by how sure they were; right is what was injected, visible or not.

    `unknown` claims no cause.
    """
    named = [(verdict, one) for verdict in verdicts for one in verdict.named if one.id in KINDS]
    said = np.array([(one.confidence, one.id in verdict.injected) for verdict, one in named])
    rows = ["| confidence | diagnoses | mean confidence | right |", "| --- | --- | --- | --- |"]
    for least, most in pairwise(CONFIDENCES):
        own = said[(said[:, 0] >= least) & (said[:, 0] < most)] if len(said) else said
        if len(own):
            label = f"{least:g} to {min(most, 1.0):g}"
            rows.append(f"| {label} | {len(own)} | {100.0 * own[:, 0].mean():.1f} % | {_percent(list(own[:, 1]))} |")
    return "\n".join(rows)


CONFIDENCES = (0.0, 0.75, 0.85, 0.92, 0.96, 0.985, 1.01)
"""Edges of the table's rows."""


def cost_table(verdicts: Sequence[Verdict]) -> str:
    """CPU seconds of a diagnosis, and flights without an answer."""
    answered = np.array([one.cpu_s for one in verdicts if not one.problem])
    problems = _counted([one.problem for one in verdicts if one.problem]) or NOTHING
    median, most = (float(np.percentile(answered, share)) if len(answered) else np.nan for share in (50.0, 95.0))
    return "\n".join(
        [
            "| flights | CPU of a diagnosis, median | 95th percentile | without an answer |",
            "| --- | --- | --- | --- |",
            f"| {len(verdicts)} | {median:.2f} s | {most:.2f} s | {problems} |",
        ]
    )


IN_VIEW = ("shares", "confusion", "healthy", "pairs", "reliability")
"""Tables that stand in the document of the flights, too, with which levels were set."""


def study_tables(verdicts: Sequence[Verdict], estimates: str | None, *, fresh: bool = True) -> Mapping[str, str]:
    """All tables by the names of their places in docs/diagnosis.md; without estimates where there are none.

    Parameters
    ----------
    fresh : whether these flights had no say when levels were set; of others there are `IN_VIEW`, so named
    """
    tables = {
        "injected": kinds_table(),
        "shares": shares_table(verdicts),
        "confusion": confusion_table(verdicts),
        "healthy": healthy_table(verdicts),
        "pairs": pairs_table(verdicts),
        "reliability": reliability_table(verdicts),
        "cost": cost_table(verdicts),
    }
    if not fresh:
        return {f"{name}_in_view": tables[name] for name in IN_VIEW}
    return tables if estimates is None else tables | {"estimates": estimates}
