"""What was tried is kept: a file for each batch, written when it is done, and read by whoever goes on.

A batch whose flight, settings or program were others is made again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.analyze.trials.tried_set import Column, Rejections, Sums, TriedSet
from fusetune.apply.search.comparison import TriedBase
from fusetune.apply.search.replays import Batch, Tried
from fusetune.apply.search.requests import values_of
from fusetune.errors import UserError
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path

_SUFFIX = ".tried.json"


class KeptPairs:
    """The batches in a folder.

    Parameters
    ----------
    made_of : of each flight, what its figures follow from beside base and sets: its log, settings, the program
    """

    def __init__(self, folder: AnyPath, made_of: Mapping[str, str]) -> None:
        self._folder, self._made_of = Path(folder), dict(made_of)

    def keep(self, batch: Batch, tried: Tried) -> None:
        """Write what a batch did."""
        flight, base, sets = batch
        named = hashlib.sha256(json.dumps([base, sets]).encode()).hexdigest()[:16]
        document = {"made_of": self._made_of[flight], **batch_document(batch, tried)}
        with atomic_path(self._folder / flight / f"{named}{_SUFFIX}") as temporary:
            write_document(temporary, document, lines=True)

    def kept(self) -> Iterator[tuple[Batch, Tried]]:
        """All batches of these flights that are still true; a file that is damaged is passed over, as if not there."""
        for flight, made_of in self._made_of.items():
            for file in sorted((self._folder / flight).glob(f"*{_SUFFIX}")):
                try:
                    document = read_document(file)
                except UserError:
                    continue
                if document["made_of"] == made_of:
                    yield batch_of(document)


def batch_document(batch: Batch, tried: Tried) -> dict[str, Any]:
    """What a batch did, as JSON has it."""
    flight, base, sets = batch
    return {
        "flight": flight,
        "base": dict(base),
        "about": _base_document(tried[0]),
        "sets": [{"values": dict(one), **_document(did)} for one, did in zip(sets, tried[1], strict=True)],
    }


def batch_of(document: Mapping[str, Any]) -> tuple[Batch, Tried]:
    """The batch that `batch_document` made it of, and what it did."""
    sets = tuple(values_of(one["values"]) for one in document["sets"])
    about = document["about"]
    place = None if about["place"] is None else VelocityPlace.from_document(about["place"])
    base = TriedBase(about["reason"], about["whiteness"], _tried(about["tried"]), place)
    return (document["flight"], values_of(document["base"]), sets), (base, tuple(map(_tried, document["sets"])))


def _base_document(base: TriedBase) -> dict[str, Any]:
    return {
        "reason": base.reason,
        "whiteness": dict(base.whiteness),
        "tried": _document(base.tried),
        "place": None if base.place is None else base.place.document(),
    }


def _document(tried: TriedSet) -> dict[str, Any]:
    return {
        "reason": tried.reason,
        "sums": [[*column, *sums] for column, sums in tried.sums.items()],
        "flight_s": tried.flight_s,
        "significant_resets": tried.significant_resets,
        "timeouts": tried.timeouts,
        "fault_s": dict(tried.fault_s),
        "rejections": [[*key, *found] for key, found in tried.rejections.items()],
    }


def _tried(document: Mapping[str, Any]) -> TriedSet:
    columns = len(Column._fields)
    return TriedSet(
        reason=document["reason"],
        sums={Column(*row[:columns]): Sums(*row[columns:]) for row in document["sums"]},
        flight_s=document["flight_s"],
        significant_resets=document["significant_resets"],
        timeouts=document["timeouts"],
        fault_s=document["fault_s"],
        rejections={(row[0], row[1]): Rejections(*row[2:]) for row in document["rejections"]},
    )
