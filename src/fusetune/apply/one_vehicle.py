"""One decision per vehicle: whose flights decide, which are left out, and from which flight it is known what flies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fusetune.apply.evidence import OTHER_VEHICLE, AnalyzedFlight, NoEvidence
from fusetune.apply.wording import named
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

_MOST_FLIGHTS_NAMED, _MOST_VEHICLES_NAMED = 3, 4


@dataclass(frozen=True)
class DecidedVehicle:
    """The vehicle that is decided for.

    Attributes
    ----------
    identity : None where there is no flight
    others : flights of other vehicles, by name
    """

    identity: VehicleIdentity | None
    others: Mapping[str, VehicleIdentity] = field(default_factory=dict)

    def without(self, flight: str) -> NoEvidence | None:
        """Why a flight has no say; None where it is of this vehicle."""
        if flight not in self.others:
            return None
        return NoEvidence(OTHER_VEHICLE, f"it is of another vehicle ({self.others[flight].in_words})")

    def document(self, own: Sequence[AnalyzedFlight], source: str | None) -> dict[str, Any] | None:
        """What `decision.json` says of it; `source` is the flight whose parameters are the present ones."""
        if self.identity is None:
            return None
        attributes = {name.removeprefix("vehicle_"): value for name, value in self.identity.columns().items()}
        return {
            "name": attributes.pop("vehicle"),
            "in_words": self.identity.in_words,
            **attributes,
            "flights": [flight.name for flight in own],
            "present_flight": source,
            "left_out": {flight: other.name for flight, other in sorted(self.others.items())},
        }

    def sentences(self) -> Iterator[str]:
        """What a pilot has to know of it; nothing where one real vehicle flew all."""
        if self.identity is None:
            return
        if not self.identity.is_real:
            yield (
                f"This is for a simulated vehicle ({self.identity.in_words}): it says nothing of a real one, whose "
                "sensors have other errors."
            )
        elif self.others:
            yield f"This is for the {self.identity.in_words}."
        if self.others:
            groups = _by_vehicle(self.others)
            left_out = [
                f"{named(flights, _MOST_FLIGHTS_NAMED)} ({vehicle.in_words})"
                for vehicle, flights in groups[:_MOST_VEHICLES_NAMED]
            ]
            which, more = " or ".join(vehicle.name for vehicle, _ in groups), ""
            if len(groups) > _MOST_VEHICLES_NAMED:
                rest = groups[_MOST_VEHICLES_NAMED:]
                count = sum(len(flights) for _, flights in rest)
                more = f"; and {count} more of {len(rest)} vehicle{'s' if len(rest) > 1 else ''}"
                which = "a name in flights.csv"
            yield (
                f"Left out, as they are of other vehicles: {'; '.join(left_out)}{more}; set `vehicle` to {which} to "
                "decide for that."
            )


def decided_vehicle(flights_table: AnyPath, flights: Sequence[str], present_flight: str | None) -> DecidedVehicle:
    """The vehicle of the flight whose parameters are the present ones.

    Parameters
    ----------
    flights_table : `results/save/flights.parquet`
    flights : names of all analysed flights
    present_flight : None where there is no flight
    """
    if present_flight is None:
        return DecidedVehicle(None)
    rows = {row["flight"]: row for row in read_table(flights_table).to_pylist()}
    vehicles = {name: VehicleIdentity.from_row(rows.get(name, {})) for name in (*flights, present_flight)}
    chosen = vehicles[present_flight]
    return DecidedVehicle(chosen, {name: one for name, one in vehicles.items() if not one.is_same(chosen)})


def source_of_present(
    own: Sequence[AnalyzedFlight], present_flight: AnalyzedFlight | None, same: Sequence[str]
) -> AnalyzedFlight | None:
    """The flight that stands for the present parameters: the newest that counts of those that flew them.

    Parameters
    ----------
    own : analysed flights of the vehicle
    present_flight : the newest of them
    same : flights with the same values, the newest first
    """
    if present_flight is None or present_flight.evidence is not None:
        return present_flight
    counting = {flight.name: flight for flight in own if flight.evidence is not None}
    return next((counting[name] for name in same if name in counting), present_flight)


def unsure_of_present(own: Sequence[AnalyzedFlight], source: AnalyzedFlight | None) -> Iterator[str]:
    """A sentence where the present parameters are known from a flight alone that does not count."""
    if source is None or source.evidence is not None or all(flight.evidence is None for flight in own):
        return
    yield (
        f"What flies now is known from {source.name} alone, which has no say itself ({source.reason}); set "
        "`present_flight` to a flight that counts if its parameters are not those of the vehicle."
    )


def _by_vehicle(others: Mapping[str, VehicleIdentity]) -> list[tuple[VehicleIdentity, list[str]]]:
    found: list[tuple[VehicleIdentity, list[str]]] = []
    for flight, vehicle in sorted(others.items()):
        for known, flights in found:
            if known.is_same(vehicle):
                flights.append(flight)
                break
        else:
            found.append((vehicle, [flight]))
    return found
