"""On which flights is searched, around what: as a file between jobs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from fusetune.errors import UserError
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path


@dataclass(frozen=True)
class SearchedFlights:
    """On which flights is searched, and around what.

    Attributes
    ----------
    flights : in order of time; may be empty
    left_out : others that can be replayed, and why
    vehicle : EKF2 parameters that the vehicle flies, name → value
    parameters : names of those that are searched
    """

    flights: tuple[str, ...]
    left_out: Mapping[str, str]
    vehicle: Mapping[str, float]
    parameters: tuple[str, ...]


def write_searched_flights(file: AnyPath, found: SearchedFlights) -> None:
    """Write what was found as JSON."""
    with atomic_path(file) as temporary:
        write_document(temporary, asdict(found), allow_nan=True)


def read_searched_flights(file: AnyPath) -> SearchedFlights:
    """Read what `write_searched_flights` wrote.

    Raises
    ------
    UserError
        There is none, or it cannot be read.
    """
    document = read_document(file)
    try:
        return SearchedFlights(
            tuple(document["flights"]), document["left_out"], document["vehicle"], tuple(document["parameters"])
        )
    except (TypeError, KeyError) as error:
        reason = f"does not say on which flights is searched ({error})"
        raise UserError(Path(file), reason, "Delete it and run the pipeline again") from error
