"""Real logs as the health table and as a calculation by hand see them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from tests.analyze.health.raw_log import RawLog

from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.health_table import health_rows
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.ulog.reader import read_ulog


class Told(NamedTuple):
    """A log and its health."""

    raw: RawLog
    rows: tuple[HealthRow, ...]

    def row(self, name: str, instance: int | None = None, origin: str = "vehicle") -> HealthRow:
        """The row of an id."""
        (found,) = (
            one
            for one in self.rows
            if (one.finding.id, one.origin) == (name, origin) and instance in (None, one.instance)
        )
        return found

    def figure(self, name: str, instance: int | None = None) -> float:
        """The figure of an id."""
        found = self.row(name, instance).finding.figure
        assert found is not None
        return found

    def ids(self, severity: str) -> set[str]:
        """Ids of one severity."""
        return {one.finding.id for one in self.rows if one.finding.severity == severity}


@pytest.fixture(scope="session")
def told(shared_logs: Path) -> Callable[[str], Told]:
    """The health of a log by the beginning of its name; each is read once."""

    @cache
    def read(name: str) -> Told:
        (path,) = shared_logs.glob(f"{name}*")
        return Told(RawLog(path), health_rows(ObservedFlight(read_ulog(path))))

    return read
