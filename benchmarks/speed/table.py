"""What was measured, as Markdown."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

from benchmarks.speed.comparison import compare
from benchmarks.speed.quantities import Quantity
from benchmarks.speed.results import Samples, SectionResults
from benchmarks.speed.revisions import Revision

SECONDS = ("s", "CPU s")
"""Units of what is told as a number of calibration loops, too."""


def written(
    revisions: Sequence[Revision],
    found: Mapping[str, Sequence[SectionResults]],
    words: Mapping[str, str],
    loop_s: float,
) -> str:
    """All sections as one table, below it what could not be measured.

    Parameters
    ----------
    revisions : the one at hand and, where there is one, the other
    found : section → its results on each revision
    words : of the machine
    loop_s : the calibration loop, CPU seconds
    """
    lines = [f"- {name}: {value}" for name, value in words.items()]
    lines += [f"- calibration loop: {loop_s * 1e3:.0f} ms of CPU time", f"- revision: {revisions[0].name}"]
    head = ["quantity", "measured", "spread", "in loops", "to reach"]
    if len(revisions) > 1:
        head = ["quantity", "measured", "spread", revisions[1].name, "spread", "ratio in loops", "to reach"]
    lines += ["", f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for section, results in found.items():
        lines.append(f"| **{section.replace('_', ' ')}** |" + " |" * (len(head) - 1))
        for name, quantity in results[0].quantities.items():
            if name in results[0].samples:
                samples = [one.samples.get(name) for one in results]
                lines.append(f"| {' | '.join(_cells(quantity, samples))} |")
    for section, results in found.items():
        for revision, one in zip(revisions, results, strict=True):
            if one.lacking or one.failed:
                reason = (one.failed or one.lacking).strip().splitlines()
                lines += ["", f"{section} on {revision.name}: {'failed' if one.failed else 'skipped'}, {reason[-1]}"]
    return "\n".join(lines) + "\n"


def _cells(quantity: Quantity, samples: Sequence[Samples | None]) -> list[str]:
    new, *others = samples
    assert new is not None
    cells = [quantity.words, f"{_figure(new.value)} {quantity.unit}".strip(), _spread(new)]
    if not others:
        in_loops = _figure(statistics.median(new.calibrated(quantity))) if quantity.unit in SECONDS else ""
        return [*cells, in_loops, _reach(quantity, new.value)]
    [old] = others
    if old is None:
        return [*cells, "", "", "", _reach(quantity, new.value)]
    told = compare(quantity, new, old)
    ratio = f"**{told.ratio:.2f} worse**" if told.is_regression else f"{told.ratio:.2f}"
    return [*cells, _figure(old.value), _spread(old), ratio, _reach(quantity, new.value)]


def _reach(quantity: Quantity, value: float) -> str:
    if quantity.reach is None:
        return ""
    reached = value >= quantity.reach if quantity.more_is_better else value <= quantity.reach
    return f"{'≥' if quantity.more_is_better else '≤'} {quantity.reach:g}{'' if reached else ' (not reached)'}"


def _spread(samples: Samples) -> str:
    return f"{samples.spread:.0%}" if len(samples.values) > 1 else "–"


def _figure(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 100.0 else f"{value:.3g}"
