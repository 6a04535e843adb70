"""What a history holds of a decision, and of what became of it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.storage.append_only import Line, append, read_lines
from fusetune.storage.files import AnyPath

DECISION, OUTCOME = "decision", "outcome"
BEFORE, AFTER = "before", "after"
"""Names of the two sets that a flight after a change is replayed with."""
SUFFIX = ".jsonl"
HISTORY_FILE = "history.json"
"""In the folder of a decision: the history of its vehicle as the page tells it."""


@dataclass(frozen=True)
class Gain:
    """By how much prediction errors shrank, percent, with its interval; None where nothing shows it.

    Attributes
    ----------
    flights : behind it
    confidence : level of the interval
    """

    percent: float | None
    lower: float | None
    upper: float | None
    flights: int
    confidence: float


@dataclass(frozen=True)
class EvidenceFlight:
    """A flight under its own parameters.

    Attributes
    ----------
    recorded : UTC of its log, ISO 8601
    scores : aim → score of the parameters that it flew with, nat
    weights : aim → weight in the score of the flight
    """

    flight: str
    checksum: str
    recorded: str
    scores: Mapping[str, float] = field(default_factory=dict)
    weights: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class DecisionEntry:
    """A decision.

    Attributes
    ----------
    key : by which lines about it are told
    written : UTC when it was kept, ISO 8601
    decided_after : UTC of the newest flight behind it; empty where no log tells
    before : estimator parameters that the vehicle had, of the baseline release
    changes : parameter → value that it was to get; empty where what flew was kept
    predicted : the gain that was expected of the change
    evidence : flights behind it that flew what the vehicle had
    of_decision : checksums of all logs that it was made from
    sets : what was compared: name, overrides, status, gain and interval of each
    """

    key: str
    written: str
    vehicle: VehicleIdentity
    product: str
    status: str
    chosen: str
    exploratory: bool
    is_loadable: bool
    decided_after: str
    before: Mapping[str, float]
    changes: Mapping[str, float]
    predicted: Gain
    evidence: Sequence[EvidenceFlight]
    of_decision: Sequence[str]
    sets: Sequence[Mapping[str, Any]]
    study: Mapping[str, str]

    @property
    def is_change(self) -> bool:
        """Whether there is something to load, and so something that flights can show."""
        return bool(self.changes) and self.is_loadable

    @property
    def after(self) -> dict[str, float]:
        """What the vehicle has when it is loaded."""
        return {**self.before, **self.changes}


@dataclass(frozen=True)
class OutcomeEntry:
    """What flights after a change show of it.

    Attributes
    ----------
    of : key of the decision
    status : `confirmed`, `refuted` or `not yet known`
    paired : the gain on the flights after it, old and new parameters replayed on each
    unpaired : the gain from the flights before to those after, each with the parameters that it flew
    against_prediction : `as predicted`, `less`, `more`, or empty where nothing shows it
    objections : what rules the new parameters out on the flights after it
    flights : checksums of the logs of the flights after it that were measured
    """

    of: str
    written: str
    status: str
    paired: Gain
    unpaired: Gain
    against_prediction: str
    objections: Sequence[str]
    flights: Sequence[str]
    names: Sequence[str]


@dataclass(frozen=True)
class History:
    """All that was kept of a vehicle, oldest first."""

    decisions: tuple[DecisionEntry, ...] = ()
    outcomes: tuple[OutcomeEntry, ...] = ()

    def outcome_of(self, entry: DecisionEntry) -> OutcomeEntry | None:
        """The last word on a decision."""
        return next((one for one in reversed(self.outcomes) if one.of == entry.key), None)


def history_file(folder: AnyPath, vehicle: VehicleIdentity) -> Path:
    """Where the history of a vehicle is kept; whatever its log calls it, that is a name of a file."""
    return Path(folder) / f"{re.sub(r'[^A-Za-z0-9._-]', '_', vehicle.name)[:100]}{SUFFIX}"


def read_history(file: AnyPath) -> History:
    """Read a history; empty where there is none.

    Raises
    ------
    UserError
        A line is not what was written.
    """
    lines = read_lines(file)
    return History(
        tuple(_decision(one) for one in lines if one.content["kind"] == DECISION),
        tuple(_outcome(one) for one in lines if one.content["kind"] == OUTCOME),
    )


def keep_decision(file: AnyPath, entry: DecisionEntry) -> bool:
    """Add a decision to the history of its vehicle; the same one is added once."""
    return _keep(file, DECISION, entry)


def keep_outcome(file: AnyPath, entry: OutcomeEntry) -> bool:
    """Add what flights show of a decision; the same is added once."""
    return _keep(file, OUTCOME, entry)


def _keep(file: AnyPath, kind: str, entry: DecisionEntry | OutcomeEntry) -> bool:
    content = {name: value for name, value in asdict(entry).items() if name not in ("key", "written")}
    return append(file, {"kind": kind, **content}, {"written": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")})


def _decision(line: Line) -> DecisionEntry:
    content = _fields(line) | {
        "key": line.key,
        "vehicle": VehicleIdentity(**line.content["vehicle"]),
        "predicted": Gain(**line.content["predicted"]),
        "evidence": tuple(EvidenceFlight(**one) for one in line.content["evidence"]),
    }
    return DecisionEntry(**content)


def _outcome(line: Line) -> OutcomeEntry:
    gains = {name: Gain(**line.content[name]) for name in ("paired", "unpaired")}
    return OutcomeEntry(**_fields(line) | gains)


def _fields(line: Line) -> dict[str, Any]:
    return {name: value for name, value in line.content.items() if name != "kind"}
