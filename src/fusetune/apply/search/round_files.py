"""Files of a search that goes on in jobs: what is asked in a round, and what a flight answered to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fusetune.apply.search.kept_pairs import batch_document, batch_of
from fusetune.apply.search.replays import Batch, Tried
from fusetune.apply.search.requests import Ask, values_of
from fusetune.apply.search.rounds import AskedOfFlights
from fusetune.errors import RUN_AGAIN, UserError
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path


@dataclass(frozen=True)
class RoundFile:
    """What is asked in a round.

    Attributes
    ----------
    number : of the round, from 1
    asks : what all searches ask, by flights
    proposals : a record of those that had to be made for it (`recorded_proposals`)
    """

    number: int
    asks: Sequence[AskedOfFlights]
    proposals: Sequence[Mapping[str, Any]]


def write_round(file: AnyPath, asked: RoundFile) -> None:
    """Write what is asked in a round as JSON."""
    asks = [{"flights": list(flights), **_ask_document(ask)} for flights, ask in asked.asks]
    document = {"round": asked.number, "asks": asks, "proposals": list(asked.proposals)}
    with atomic_path(file) as temporary:
        write_document(temporary, document, lines=True, allow_nan=False)


def read_round(file: AnyPath) -> RoundFile:
    """Read what `write_round` wrote.

    Raises
    ------
    UserError
        There is none, or it cannot be read.
    """
    document = read_document(file)
    try:
        asks = [(tuple(one["flights"]), _ask_of(one)) for one in document["asks"]]
        return RoundFile(document["round"], asks, document["proposals"])
    except (TypeError, KeyError) as error:
        raise UserError(file, f"does not say what a search asks ({error})", RUN_AGAIN) from error


def write_tried(file: AnyPath, flight: str, pairs: Iterable[tuple[Batch, Tried]]) -> None:
    """Write what sets did on a flight as JSON."""
    document = {"flight": flight, "batches": [batch_document(batch, tried) for batch, tried in pairs]}
    with atomic_path(file) as temporary:
        write_document(temporary, document, lines=True)


def read_tried(file: AnyPath) -> list[tuple[Batch, Tried]]:
    """Read what `write_tried` wrote.

    Raises
    ------
    UserError
        There is none, or it cannot be read.
    """
    document = read_document(file)
    try:
        return [batch_of(one) for one in document["batches"]]
    except (TypeError, KeyError) as error:
        raise UserError(file, f"does not say what was tried ({error})", RUN_AGAIN) from error


def _ask_document(ask: Ask) -> dict[str, Any]:
    seen_by = None if ask.seen_by is None else dict(ask.seen_by)
    return {"stage": ask.stage, "base": dict(ask.base), "sets": [dict(one) for one in ask.sets], "seen_by": seen_by}


def _ask_of(document: Mapping[str, Any]) -> Ask:
    seen_by = document["seen_by"]
    return Ask(
        document["stage"],
        values_of(document["base"]),
        tuple(map(values_of, document["sets"])),
        None if seen_by is None else values_of(seen_by),
    )
