"""On which flights is searched, around what: as a file between jobs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from fusetune.storage.documents import read_as, write_document
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
    return read_as(file, _flights_of, "on which flights is searched")


def _flights_of(document: dict[str, Any]) -> SearchedFlights:
    return SearchedFlights(
        tuple(document["flights"]), document["left_out"], document["vehicle"], tuple(document["parameters"])
    )
