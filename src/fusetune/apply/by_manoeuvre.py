"""By how much each set differs from the present one in each manoeuvre class, and on each leg of each mission.

By the statistics of the decision (`mean_differences`), over the flights that have the class or flew the leg. Many
comparisons stand side by side here, so they tell where a set is better, and not that it is: the decision does not
choose by them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from fusetune.analyze.flight.manoeuvre_classes import FLOWN_CLASSES
from fusetune.apply.evidence import FlightEvidence
from fusetune.apply.pieces_evidence import PiecesOfFlight, evidence_in
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.mean_difference import mean_differences


@dataclass(frozen=True)
class PartComparison:
    """A set against the present one in a part of the flights; differences of scores, nat, below 0 is better.

    Attributes
    ----------
    mission, leg : of a leg; empty and None of a manoeuvre class
    manoeuvre : of a class; empty of a leg
    flights : that have it
    lower, upper : None where nothing shows the spread
    """

    name: str
    mission: str
    leg: int | None
    manoeuvre: str
    flights: int
    difference: float
    lower: float | None
    upper: float | None


def by_manoeuvre(
    evidence: Sequence[FlightEvidence],
    pieces: Mapping[str, PiecesOfFlight],
    sets: Sequence[str],
    present: str,
    settings: DecisionSettings,
) -> list[PartComparison]:
    """Compare all sets in every class, then on every leg of every mission that was flown.

    Parameters
    ----------
    evidence : of the flights that decide, the whole of each
    pieces : of flights by name; those of a flight may be lacking
    """
    known = [one for one in evidence if one.flight in pieces]
    found = []
    for kind in FLOWN_CLASSES:
        parts = [evidence_in(one, pieces[one.flight], pieces[one.flight].of_classes([kind])) for one in known]
        found += _compared(parts, sets, present, settings, manoeuvre=kind)
    for mission in sorted({pieces[one.flight].mission for one in known} - {""}):
        on_it = [one for one in known if pieces[one.flight].mission == mission]
        for leg in sorted({leg for one in on_it for leg in pieces[one.flight].legs}):
            parts = [evidence_in(one, pieces[one.flight], pieces[one.flight].of_leg(leg)) for one in on_it]
            found += _compared(parts, sets, present, settings, mission=mission, leg=leg)
    return found


def _compared(
    parts: Iterable[FlightEvidence | None],
    sets: Sequence[str],
    present: str,
    settings: DecisionSettings,
    *,
    manoeuvre: str = "",
    mission: str = "",
    leg: int | None = None,
) -> list[PartComparison]:
    flights = [one for one in parts if one is not None and present in one.sets]
    if not flights:
        return []
    names = [present, *(one for one in sets if one != present and all(one in flight.row for flight in flights))]
    if len(names) == 1:
        return []
    differences = mean_differences(flights, names, settings)
    return [
        PartComparison(name, mission, leg, manoeuvre, one.flights, one.difference, one.lower, one.upper)
        for name, one in zip(names[1:], differences[1:], strict=True)
    ]


def only_classes_sentences(settings: DecisionSettings) -> tuple[str, ...]:
    """That the decision rests on some manoeuvres alone, where it does."""
    if not settings.only_classes:
        return ()
    return (f"Of each flight its {', '.join(settings.only_classes)} alone counts, as `decision.only_classes` says.",)
