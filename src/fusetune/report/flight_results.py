"""What the page of a flight reads: its diagnoses, its health, its effects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.analyze.flight_files import DIAGNOSIS_FILE, EFFECTS_FILE, HEALTH_FILE
from fusetune.report.severity_words import FlightTimes, rank
from fusetune.storage.documents import read_as
from fusetune.storage.files import AnyPath

_SUMS = ("status",)
"""Groups of figures that say again what the aid sources say."""

Document = Mapping[str, Any]


@dataclass(frozen=True)
class FlightResults:
    """Documents of one flight.

    Attributes
    ----------
    vehicle, firmware, date, mission : as the log tells them; empty where it does not
    replayed_as, replayed_why : the release of PX4 whose estimator replays it, and why it is not the one that flew;
        empty where that is not known
    start_us : of its log, since boot
    diagnoses : what explains most first
    health : rows of the health table
    effects : as the tuners tell them
    is_readable : whether anything of the log could be read
    refusals : why it is not replayed, `found` and `remedy`; of a flight that is, none
    untold : what could not be told of it at all, as `health`
    """

    flight: str
    vehicle: str
    firmware: str
    replayed_as: str
    replayed_why: str
    date: str
    mission: str
    start_us: int
    diagnoses: tuple[Document, ...]
    health: tuple[Document, ...]
    effects: tuple[Document, ...]
    is_readable: bool = True
    refusals: tuple[Document, ...] = ()
    untold: tuple[str, ...] = ()

    @property
    def times(self) -> FlightTimes:
        """Take-off and landing."""
        known = {row["id"]: row["figure"] for row in self.health if row["figure"] is not None}
        return FlightTimes(known.get("flight.take_off_s", math.nan), known.get("flight.landing_s", math.nan))

    @property
    def problems(self) -> tuple[Document, ...]:
        """Rows of the health table beyond their limits, failures first."""
        found = [row for row in self.health if row["severity"] in ("warning", "fail")]
        return tuple(sorted(found, key=lambda row: rank(row["severity"])))

    @property
    def problem_subjects(self) -> tuple[Document, ...]:
        """Of each source, sensor or part of the filter that has a row beyond its limit the worst one.

        Failures first, what the filter's status only sums up after what it is made of, then by when they begin.
        """

        def order(row: Document) -> tuple[int, bool, float]:
            begins = math.inf if row["start_us"] is None else row["start_us"]
            return rank(row["severity"]), row["group"] in _SUMS, begins

        first: dict[str, Document] = {}
        for row in sorted(self.problems, key=order):
            first.setdefault(row["id"].partition(".")[0], row)
        return tuple(first.values())

    def since_start_s(self, row: Document) -> tuple[float, float] | None:
        """When a row of the health table holds, seconds from the start of the log."""
        if row["start_us"] is None or row["stop_us"] is None:
            return None
        return (row["start_us"] - self.start_us) * 1e-6, (row["stop_us"] - self.start_us) * 1e-6


def read_flight_results(folder: AnyPath) -> FlightResults:
    """Read `results/analyze/<flight>`.

    Raises
    ------
    UserError
        One of the three documents is missing or damaged, or tells of something else.
    """
    folder = Path(folder)
    told = read_as(folder / DIAGNOSIS_FILE, _diagnosed, "what is wrong with a flight")
    effects = read_as(folder / EFFECTS_FILE, lambda one: tuple(one["effects"]), "the effects on a flight")

    def with_health(document: Document) -> FlightResults:
        names = ("flight", "vehicle", "firmware", "date", "mission")
        named: dict[str, Any] = {name: str(document[name] or "") for name in names}
        # results of before it was chosen lack these
        named |= {name: str(document.get(name, "")) for name in ("replayed_as", "replayed_why")}
        return FlightResults(
            **named,
            **told,
            start_us=int(document["start_us"]),
            health=tuple(document["rows"]),
            effects=effects,
        )

    return read_as(folder / HEALTH_FILE, with_health, "the health of a flight")


def _diagnosed(document: Document) -> dict[str, Any]:
    """What `diagnosis.json` tells, by the names of `FlightResults`."""
    return {
        "diagnoses": tuple(document["diagnoses"]),
        "is_readable": bool(document["readable"]),
        "refusals": tuple(document["refused"]),
        "untold": tuple(document["not_told"]),
    }
