"""The line that a history keeps of a decision, from what the decision wrote."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import pyarrow as pa

from fusetune.apply.evidence import AIMS
from fusetune.apply.history.entries import DecisionEntry, EvidenceFlight, Gain
from fusetune.apply.history.flights_after import FlownFlight, flew
from fusetune.apply.ranking import improvement_percent
from fusetune.px4.vehicle_identity import VehicleIdentity


def decision_entry(
    decision: Mapping[str, Any], per_flight: pa.Table, flown: Mapping[str, FlownFlight]
) -> DecisionEntry | None:
    """What to keep of a decision; None where it is for no vehicle.

    Parameters
    ----------
    decision : `decision.json`
    per_flight : `per_flight.parquet`
    flown : the replayable flights of the vehicle, by name
    """
    newest = flown.get(decision["newest_flight"])
    if decision["vehicle"] is None or newest is None:
        return None
    of_vehicle = {one.name: decision["vehicle"][one.name] for one in fields(VehicleIdentity)}
    previous = {one["name"]: one["previous"] for one in decision["changes"]}
    before = {**newest.parameters, **previous}
    confidence = decision["rule"]["confidence"]
    chosen = next((one for one in decision["ranking"] if one["name"] == decision["chosen"]), None)
    return DecisionEntry(
        key="",
        written="",
        vehicle=VehicleIdentity(**of_vehicle),
        product=decision["provenance"]["product"],
        status=decision["status"],
        chosen=decision["chosen"],
        exploratory=decision["exploratory"],
        is_loadable=not decision["on_vehicle"]["refused"],
        decided_after=max((one.recorded for one in flown.values()), default=""),
        before=before,
        changes={one["name"]: one["value"] for one in decision["changes"]},
        predicted=_gain(chosen, confidence)
        if chosen is not None and decision["changes"]
        else Gain(None, None, None, 0, confidence),
        evidence=_evidence(decision, per_flight, flown, before),
        of_decision=[row["checksum"] for row in decision["flights"] if row["checksum"]],
        sets=_sets(decision),
        study=decision["provenance"]["configuration_files"],
    )


def _gain(ranked: Mapping[str, Any], confidence: float) -> Gain:
    """A set's gain with its interval: below 0 a difference of scores is better."""
    lower, upper = (None if ranked[end] is None else improvement_percent(ranked[end]) for end in ("upper", "lower"))
    return Gain(ranked["improvement_percent"], lower, upper, ranked["flights"], confidence)


def _evidence(
    decision: Mapping[str, Any], per_flight: pa.Table, flown: Mapping[str, FlownFlight], before: Mapping[str, float]
) -> list[EvidenceFlight]:
    """Flights that flew what the vehicle had, with what the evidence says of that."""
    found = []
    for row in per_flight.to_pylist():
        flight = flown.get(row["flight"])
        if row["set"] != decision["present"] or flight is None or not flew(flight, before):
            continue
        scores = {aim: row[f"{aim}_score"] for aim in AIMS if row[f"{aim}_score"] == row[f"{aim}_score"]}
        weights = decision["weights"][row["flight"]]
        found.append(EvidenceFlight(flight.flight, flight.checksum, flight.recorded, scores, weights))
    return found


def _sets(decision: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    overrides = {one["set"]: one["overrides"] for one in decision["sets"]}
    kept = ("name", "status", "score", "p_family", "flights", "flights_better")
    return [
        {name: one[name] for name in kept}
        | {
            "overrides": overrides.get(one["name"], {}),
            "gain": vars(_gain(one, decision["rule"]["confidence"])) if one["flights"] else None,
        }
        for one in decision["ranking"]
    ]
