"""Two folders of results side by side: what they decided, and by how much their figures differ.

They may be of two releases of the product: only what both hold is compared, and what one of them lacks is told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from fusetune.apply.decision_summary import decision_summary
from fusetune.apply.flat_settings import changed_settings
from fusetune.apply.results_folder import ResultsFolder
from fusetune.errors import UserError
from fusetune.storage.parquet import read_table

EQUAL_WITHIN_PERCENT = 1e-6
"""Files hold nine digits of a score; what differs by less is rounding."""


@dataclass(frozen=True)
class ComparedSet:
    """A set in both rankings: its change of the prediction error against what flies now, percent, below 0 is better."""

    name: str
    a_percent: float | None
    b_percent: float | None
    a_status: str
    b_status: str
    a_rank: int | None
    b_rank: int | None


@dataclass(frozen=True)
class ComparedFlight:
    """The scores of a flight that both have.

    Attributes
    ----------
    same_log : whether both read the same bytes
    a_counts, b_counts : whether it has a say
    largest_percent : by how much the prediction error of any set is larger in B; that of the largest amount
    of_set : by which set
    """

    flight: str
    same_log: bool
    a_counts: bool
    b_counts: bool
    largest_percent: float | None
    of_set: str


@dataclass(frozen=True)
class ComparedResults:
    """Two results, A and B.

    Attributes
    ----------
    a, b : product, decision in short, number of flights with a say
    settings : setting of the decision → its values, where they differ
    files : configuration files that differ, or that one of them lacks
    parameters : name → values that A and B set; None where one leaves it
    only_a, only_b : flights of one alone
    """

    a: dict[str, Any]
    b: dict[str, Any]
    settings: dict[str, tuple[Any, Any]]
    files: tuple[str, ...]
    parameters: dict[str, tuple[float | None, float | None]]
    sets: tuple[ComparedSet, ...]
    flights: tuple[ComparedFlight, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]

    @property
    def same_decision(self) -> bool:
        """Whether both say the same is to be flown."""
        return (self.a["decision"], self.a["chosen"]) == (self.b["decision"], self.b["chosen"]) and all(
            before == after for before, after in self.parameters.values()
        )

    @property
    def largest_percent(self) -> float:
        """By how much any score of any flight differs, the largest amount."""
        return max((abs(one.largest_percent) for one in self.flights if one.largest_percent is not None), default=0.0)

    @property
    def are_equal(self) -> bool:
        """Whether neither decision nor any figure differs."""
        return (
            self.same_decision
            and not (self.only_a or self.only_b or self.settings)
            and self.largest_percent <= EQUAL_WITHIN_PERCENT
            and all(one.a_counts == one.b_counts and one.same_log for one in self.flights)
            and all(
                one.a_status == one.b_status and one.a_rank == one.b_rank and _same(one.a_percent, one.b_percent)
                for one in self.sets
            )
        )

    def document(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "equal": self.are_equal,
            "same_decision": self.same_decision,
            "a": self.a,
            "b": self.b,
            "settings": {name: {"a": one, "b": other} for name, (one, other) in self.settings.items()},
            "configuration_files": list(self.files),
            "parameters": [{"name": name, "a": one, "b": other} for name, (one, other) in self.parameters.items()],
            "sets": [asdict(one) for one in self.sets],
            "flights": [asdict(one) for one in self.flights],
            "flights_of_a_alone": list(self.only_a),
            "flights_of_b_alone": list(self.only_b),
            "largest_score_difference_percent": self.largest_percent,
        }


def compare_results(a: ResultsFolder, b: ResultsFolder) -> ComparedResults:
    """Compare what two runs decided, and the scores that they decided by.

    Raises
    ------
    UserError
        A file is missing, damaged, or of a release that is not understood.
    """
    documents = [_decision(one) for one in (a, b)]
    one, other = documents
    flights = [{row["flight"]: row for row in document["flights"]} for document in documents]
    hashes = [document["provenance"]["configuration_files"] for document in documents]
    return ComparedResults(
        a=_told(a, one),
        b=_told(b, other),
        settings=changed_settings(one["rule"], other["rule"]),
        files=tuple(sorted(name for name in {*hashes[0], *hashes[1]} if hashes[0].get(name) != hashes[1].get(name))),
        parameters=_parameters(one, other),
        sets=_sets(one, other),
        flights=tuple(_flights(a, b, *flights)),
        only_a=tuple(sorted(flights[0].keys() - flights[1].keys())),
        only_b=tuple(sorted(flights[1].keys() - flights[0].keys())),
    )


def _decision(results: ResultsFolder) -> dict[str, Any]:
    decision = results.decision
    needed = ("status", "chosen", "ranking", "changes", "flights", "rule", "provenance")
    missing = [name for name in needed if name not in decision]
    if missing:
        reason = f"is of a release that is not understood: it lacks {', '.join(missing)}"
        raise UserError(results.decision_file, reason, "Make it anew with this release")
    return decision


def _told(results: ResultsFolder, decision: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "folder": str(results.path),
        "product": decision["provenance"]["product"],
        "flights": decision["flights_scored"],
        **decision_summary(decision).document(),
    }


def _parameters(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, tuple[float | None, float | None]]:
    values = [{change["name"]: float(change["value"]) for change in document["changes"]} for document in (one, other)]
    return {name: (values[0].get(name), values[1].get(name)) for name in sorted({*values[0], *values[1]})}


def _sets(one: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[ComparedSet, ...]:
    rows = [
        {row["name"]: (rank, row) for rank, row in enumerate(document["ranking"], start=1)} for document in (one, other)
    ]
    compared = []
    for name in dict.fromkeys((*rows[0], *rows[1])):
        (a_rank, a), (b_rank, b) = (each.get(name, (None, None)) for each in rows)
        compared.append(
            ComparedSet(
                name,
                _change(a),
                _change(b),
                "missing" if a is None else a["status"],
                "missing" if b is None else b["status"],
                a_rank,
                b_rank,
            )
        )
    return tuple(compared)


def _change(row: Mapping[str, Any] | None) -> float | None:
    """Change of the prediction error, percent, below 0 is better."""
    gain = None if row is None else row["improvement_percent"]
    return None if gain is None or not math.isfinite(gain) else -float(gain)


def _same(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return abs(one - other) <= EQUAL_WITHIN_PERCENT


def _flights(
    a: ResultsFolder, b: ResultsFolder, of_a: Mapping[str, Any], of_b: Mapping[str, Any]
) -> list[ComparedFlight]:
    scores = [_scores(one) for one in (a, b)]
    compared = []
    for flight in sorted(of_a.keys() & of_b.keys()):
        one, other = of_a[flight], of_b[flight]
        mine, theirs = (each.get(flight, {}) for each in scores)
        differences = {
            name: 100.0 * math.expm1(theirs[name] - mine[name])
            for name in mine
            if name in theirs and math.isfinite(mine[name]) and math.isfinite(theirs[name])
        }
        largest = max(differences, key=lambda name: abs(differences[name]), default="")
        compared.append(
            ComparedFlight(
                flight,
                one["checksum"] == other["checksum"],
                bool(one["scored"]),
                bool(other["scored"]),
                differences.get(largest),
                largest,
            )
        )
    return compared


def _scores(results: ResultsFolder) -> dict[str, dict[str, float]]:
    """Score of every set on every flight that has a say, nat."""
    table = read_table(results.path / "apply" / "per_flight.parquet").select(["flight", "set", "score"])
    scores: dict[str, dict[str, float]] = {}
    for row in table.to_pylist():
        if row["score"] is not None:
            scores.setdefault(row["flight"], {})[row["set"]] = float(row["score"])
    return scores
