"""`trials.json`: sets that were tried on flights, so that what they tell can be shown without replaying them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.apply.rounded import rounded
from fusetune.apply.trials import Trials
from fusetune.design.factors import Factor
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path

TRIALS_FILE = "trials.json"

Array = npt.NDArray[np.float64]


def write_trials(path: AnyPath, trials: Trials | None) -> None:
    """Write the file; None says that nothing was varied."""
    with atomic_path(path) as temporary:
        write_document(temporary, {"trials": _document(trials)}, lines=True, allow_nan=False)


def read_trials(path: AnyPath) -> Trials | None:
    """Read the file; `UserError` where it is missing or damaged."""
    document = read_document(path)["trials"]
    if document is None:
        return None
    flights = len(document["flights"])
    return Trials(
        factors=tuple(Factor(**one) for one in document["factors"]),
        names=tuple(document["names"]),
        values=_table(document["values"], len(document["factors"])),
        flights=tuple(document["flights"]),
        differences=_table(document["differences"], flights),
        aims={aim: _table(rows, flights) for aim, rows in document["aims"].items()},
        allowed=np.array(document["allowed"], dtype=bool).reshape(-1, flights),
    )


def _document(trials: Trials | None) -> dict[str, Any] | None:
    if trials is None:
        return None
    document: dict[str, Any] = rounded(
        {
            "factors": [asdict(one) for one in trials.factors],
            "names": list(trials.names),
            "values": trials.values.tolist(),
            "flights": list(trials.flights),
            "differences": trials.differences.tolist(),
            "aims": {aim: rows.tolist() for aim, rows in trials.aims.items()},
            "allowed": trials.allowed.tolist(),
        }
    )
    return document


def _table(rows: list[list[float | None]], columns: int) -> Array:
    """None stands for NaN, which JSON has no word for."""
    return np.array(rows, dtype=np.float64).reshape(-1, columns)
