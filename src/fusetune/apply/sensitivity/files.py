"""`sensitivity.json`: what the sets tell of the parameters, in figures and in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from fusetune.apply.rounded import rounded
from fusetune.apply.sensitivity.result import Curve, FitQuality, ParameterSensitivity, Sensitivity, TradeOff, TriedSet
from fusetune.apply.sensitivity.wording import NOTHING_VARIED, sentences
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path

SENSITIVITY_FILE = "sensitivity.json"
_SIGNIFICANT_DIGITS = 5
"""What solving for hundreds of sets keeps whatever the number of cores."""


@dataclass(frozen=True)
class ToldSensitivity:
    """What the file holds: the words, and the figures; None where no set changes a parameter that has a scale."""

    sentences: tuple[str, ...]
    found: Sensitivity | None


NOTHING_TOLD = ToldSensitivity((NOTHING_VARIED,), None)


def write_sensitivity(path: AnyPath, found: Sensitivity | None) -> None:
    """Write the file; None says that nothing was varied."""
    words = sentences(found) if found is not None else NOTHING_TOLD.sentences
    figures = rounded(asdict(found), _SIGNIFICANT_DIGITS) if found is not None else None
    with atomic_path(path) as temporary:
        write_document(temporary, {"sentences": list(words), "sensitivity": figures}, allow_nan=False)


def read_sensitivity(path: AnyPath) -> ToldSensitivity:
    """Read the file; `UserError` where it is missing or damaged."""
    document = read_document(path)
    figures = document["sensitivity"]
    return ToldSensitivity(tuple(document["sentences"]), _sensitivity(figures) if figures is not None else None)


def _sensitivity(figures: Mapping[str, Any]) -> Sensitivity:
    quality = figures["quality"]
    return Sensitivity(
        flights=figures["flights"],
        confidence=figures["confidence"],
        quality=FitQuality(**quality) if quality is not None else None,
        spread=figures["spread"],
        parameters=tuple(map(_parameter, figures["parameters"])),
        trade_offs=tuple(TradeOff(**one) for one in figures["trade_offs"]),
        tried=tuple(TriedSet(**_tuples(one)) for one in figures["tried"]),
    )


def _parameter(figures: Mapping[str, Any]) -> ParameterSensitivity:
    curve = figures["curve"]
    return ParameterSensitivity(**_tuples(figures) | {"curve": Curve(**_tuples(curve)) if curve is not None else None})


def _tuples(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Lists as the tuples that they were."""
    return {key: tuple(value) if isinstance(value, list) else value for key, value in figures.items()}
