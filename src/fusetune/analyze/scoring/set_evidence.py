"""How much of the evidence of a flight each set has itself, and what it cost itself: for `scoring.json`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from fusetune.analyze.replaying.samples import SourceAxis
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.withheld_scores import CountedGaps


def set_evidence(
    samples: Mapping[SourceAxis, EvidenceCost],
    gaps: Sequence[CountedGaps],
    own_resets_s: float,
    max_lacking_percent: float,
) -> dict[str, Any]:
    """The evidence of a set, as JSON can hold it.

    Parameters
    ----------
    samples : what it cost itself, by source and axis
    own_resets_s : scored time around resets of its own
    max_lacking_percent : a set that lacks more is left out

    Returns
    -------
    `samples` and `gaps` hold by source what of the mask the set lacks, and what of it follows its own resets (of its
    axes and horizons the one that costs most); `own_resets_s`; `left_out` says of each source why the set is not
    compared there.
    """
    of_samples = _dearest((source, cost) for (source, _), cost in samples.items())
    of_gaps = _dearest((one.mask.source, one.cost) for one in gaps)
    left_out = {
        source: f"lacks {one.lacking} of {one.mask} {what} of {source} that the present set has, "
        f"more than {max_lacking_percent:g} %"
        for what, costs in (("gaps", of_gaps), ("samples", of_samples))
        for source, one in costs.items()
        if one.lacking_percent > max_lacking_percent
    }
    return {
        "samples": {source: asdict(one) for source, one in of_samples.items()},
        "gaps": {source: asdict(one) for source, one in of_gaps.items()},
        "own_resets_s": round(own_resets_s, 3),
        "left_out": left_out,
    }


def _dearest(costs: Iterable[tuple[str, EvidenceCost]]) -> dict[str, EvidenceCost]:
    """By source, the one of which most is lost."""
    found: dict[str, EvidenceCost] = {}
    for source, one in costs:
        if source not in found or one.lost_percent > found[source].lost_percent:
            found[source] = one
    return found
