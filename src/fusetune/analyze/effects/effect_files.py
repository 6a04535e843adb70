"""Effects of one flight as its file holds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath


def effects_document(flight: str, effects: Sequence[Effect]) -> dict[str, Any]:
    """Effects of one flight as JSON holds them."""
    return {"flight": flight, "effects": [one.document() for one in effects]}


def read_effects(file: AnyPath) -> tuple[Effect, ...]:
    """Read what `effects_document` made; `UserError` where that cannot be."""
    return tuple(_effect_of(one) for one in read_document(file)["effects"])


def _effect_of(document: Mapping[str, Any]) -> Effect:
    estimates = tuple(Estimate(**one) for one in document["estimates"])
    return Effect(document["id"], estimates, document["refusal"], document["figures"])
