"""How much of the evidence of a flight each set has itself, and what it cost itself: for `scoring.json`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from fusetune.analyze.replaying.samples import SourceAxis
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.withheld_scores import PairedGaps


def set_evidence(
    sets: Sequence[str],
    window: ScoringWindow,
    samples: Mapping[SourceAxis, Mapping[str, EvidenceCost]],
    gaps: Sequence[PairedGaps],
    settings: ScoringSettings,
) -> dict[str, dict[str, Any]]:
    """By set: its evidence, as JSON can hold it.

    Returns
    -------
    `samples` and `gaps` hold by source what of the mask the set lacks, and what of it follows its own resets (of its
    axes and horizons the one that costs most); `own_resets_s` is the scored time around these; `left_out` says of each
    source why the set is not compared there.
    """
    return {name: _of_set(name, window, samples, gaps, settings) for name in sets}


def _of_set(
    name: str,
    window: ScoringWindow,
    samples: Mapping[SourceAxis, Mapping[str, EvidenceCost]],
    gaps: Sequence[PairedGaps],
    settings: ScoringSettings,
) -> dict[str, Any]:
    of_samples = _dearest((source, costs[name]) for (source, _), costs in samples.items() if name in costs)
    of_gaps = _dearest((group.source, group.costs[name]) for group in gaps if name in group.costs)
    left_out = {
        source: f"lacks {one.lacking} of {one.mask} {what} of {source} that the present set has, "
        f"more than {settings.max_lacking_percent:g} %"
        for what, costs in (("gaps", of_gaps), ("samples", of_samples))
        for source, one in costs.items()
        if one.lacking_percent > settings.max_lacking_percent
    }
    return {
        "samples": {source: asdict(one) for source, one in of_samples.items()},
        "gaps": {source: asdict(one) for source, one in of_gaps.items()},
        "own_resets_s": round(window.own_resets_s(name), 3),
        "left_out": left_out,
    }


def _dearest(costs: Iterable[tuple[str, EvidenceCost]]) -> dict[str, EvidenceCost]:
    """By source, the one of which most is lost."""
    found: dict[str, EvidenceCost] = {}
    for source, one in costs:
        if source not in found or one.lost_percent > found[source].lost_percent:
            found[source] = one
    return found
