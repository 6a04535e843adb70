"""Proposals that were made before are taken from a record: who goes through a search again need not think it over.

A proposal is known by all that it follows from, so a record can save work, and never mislead.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from fusetune.apply.search.proposals import Array, Proposing, propose
from fusetune.apply.search.space import Space
from fusetune.storage.digest import source_digest
from fusetune.storage.ledger import key_of

_MADE_BY = (
    "apply/search/proposals.py",
    "apply/search/space.py",
    "apply/search/surrogate.py",
    "design/factors.py",
    "px4/parameters",
)


class RecordedProposals:
    """`propose`, with a record.

    Parameters
    ----------
    record : of proposals made before, as `new` gives them
    proposing : makes those that are not in it
    """

    def __init__(self, record: Iterable[Mapping[str, Any]] = (), proposing: Proposing = propose) -> None:
        self._known = {one["made_of"]: one["sets"] for one in record}
        self._proposing = proposing
        self._program = source_digest(*_MADE_BY)
        self.new: list[dict[str, Any]] = []
        """Those that were not in the record: from what they were made, and sets."""

    def __call__(
        self, space: Space, points: Array, scores: Array, number: int, radius: float, seed: Sequence[int]
    ) -> list[dict[str, float]]:
        """Sets to try after those at some points."""
        factors = [asdict(one) for one in space.factors]
        key = key_of([self._program, factors, points.tolist(), scores.tolist(), number, radius, list(seed)])
        if key not in self._known:
            self._known[key] = self._proposing(space, points, scores, number, radius, seed)
            self.new.append({"made_of": key, "sets": self._known[key]})
        return [dict(one) for one in self._known[key]]
