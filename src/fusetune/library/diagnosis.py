"""What is wrong with a vehicle, from one of its flights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from fusetune.analyze.diagnosis.diagnose import diagnose as diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, how_sure
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.storage.files import AnyPath

if TYPE_CHECKING:
    from fusetune.library.log import Log

_COLUMNS = ("id", "cause", "severity", "confidence", "how_sure", "since_s", "until_s", "remedy")


@dataclass(frozen=True)
class DiagnosedFlight:
    """The causes that a flight shows.

    Attributes
    ----------
    flight : its name
    causes : what explains most first; each with `cause`, `severity`, `confidence`, `signs`, `remedy`, `values`
    start_timestamp : of the log, µs since boot
    """

    flight: str
    causes: tuple[Diagnosis, ...]
    start_timestamp: int

    def __str__(self) -> str:
        if not self.causes:
            return f"{self.flight}: nothing found"
        return "\n".join(f"{one.severity}: {one.cause} ({how_sure(one.confidence)})" for one in self.causes)

    @property
    def table(self) -> pd.DataFrame:
        """One row per cause: id, cause, severity, confidence (0 … 1), how_sure, since_s, until_s, remedy."""
        rows = [one.document(self.start_timestamp) | {"how_sure": how_sure(one.confidence)} for one in self.causes]
        return pd.DataFrame([{name: row[name] for name in _COLUMNS} for row in rows], columns=list(_COLUMNS))


def of_observed(observed: ObservedFlight, experiments: int) -> DiagnosedFlight:
    """The diagnosis of a flight that was read."""
    return DiagnosedFlight(
        observed.logged.name, tuple(diagnosed(observed, experiments)), observed.logged.start_timestamp
    )


def diagnose(log: AnyPath | Log, experiments: int = 2) -> DiagnosedFlight:
    """What is wrong with the vehicle that flew a log.

    Parameters
    ----------
    log : a `.ulg` file, the folder of a saved flight, or what `read` gave
    experiments : how often at most the flight is replayed with a claimed cause taken away

    Raises
    ------
    UserError
        The log cannot be read.
    """
    from fusetune.library.log import Log, read

    return (log if isinstance(log, Log) else read(log)).diagnose(experiments)
