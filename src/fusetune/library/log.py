"""A flight log in memory: its topics and parameters, and what can be asked of it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

import pandas as pd

from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare_flight
from fusetune.analyze.replaying.settings import WITHOUT_GAPS
from fusetune.design.parameter_check import checked_values
from fusetune.library.diagnosis import DiagnosedFlight, of_observed
from fusetune.library.replay import Replay
from fusetune.px4.flight import Flight
from fusetune.px4.releases import AUTO
from fusetune.px4.ulog.reader import read_ulog
from fusetune.save.flight_folder import load_flight
from fusetune.save.verdict import Verdict
from fusetune.storage.files import AnyPath


class Log:
    """One flight log, made by `read`.

    Attributes
    ----------
    path : where it was read from
    """

    def __init__(self, path: AnyPath, flight: Flight) -> None:
        self.path = Path(path)
        self._observed = ObservedFlight(flight, WITHOUT_GAPS)

    def __repr__(self) -> str:
        return f"<Log {self.name}: PX4 {self.release}, {self.duration_s:.0f} s, {self.verdict.status}>"

    @property
    def name(self) -> str:
        """The file's name without `.ulg`."""
        return self._flight.name

    @property
    def release(self) -> str:
        """Firmware release as PX4 writes it, such as "v1.16.0"; "unknown" where the log does not say."""
        return self._flight.release_name

    @property
    def duration_s(self) -> float:
        """Seconds from the start of the log to its last message."""
        return self._flight.duration_s

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters of the vehicle at the end of the log, by PX4's names."""
        return self._flight.parameters.at_end()

    @property
    def topics(self) -> list[str]:
        """Topics that the log holds, sorted."""
        return sorted({name for name, _ in self._flight.topics})

    @property
    def verdict(self) -> Verdict:
        """Whether the flight can be replayed, and why not: `status`, `reasons`, `warnings`, `findings`."""
        return self._observed.verdict

    def topic(self, name: str, instance: int = 0) -> pd.DataFrame:
        """One topic as a table: its fields as PX4 names them, and `time_s`, seconds since the log began.

        Raises
        ------
        KeyError
            The log has no such topic or instance.
        """
        table = self._flight.topics[name, instance]
        time_s = (table["timestamp"] - self._flight.start_timestamp) * 1e-6
        return pd.DataFrame({"time_s": time_s, **table})

    def replay(self, parameters: Mapping[str, float] | None = None, *, release: str = AUTO) -> Replay:
        """Fly the log's sensor data through EKF2 again.

        Parameters
        ----------
        parameters : those that differ from the log's own, by PX4's names; without any the filter flies as it flew
        release : whose EKF2 it is, such as "v1.17" or "main"; "auto": that which flew, or the nearest that is modelled

        Raises
        ------
        UserError
            The flight cannot be replayed (`verdict` says why), the release is not modelled, or it has no such
            parameter or forbids the value.
        """
        prepared = self._prepared.as_replayed_by(release)
        overrides = checked_values(parameters or {}, "replay", prepared.replayed.release)
        return Replay(prepared, overrides, self._flight.start_timestamp)

    def diagnose(self, experiments: int = 2) -> DiagnosedFlight:
        """What is wrong with the vehicle, what explains most first.

        Parameters
        ----------
        experiments : how often at most the flight is replayed with a claimed cause taken away
        """
        return of_observed(self._observed, experiments)

    @property
    def _flight(self) -> Flight:
        return self._observed.logged

    @cached_property
    def _prepared(self) -> PreparedFlight:
        self.verdict.demand_replayable(self.path)
        return prepare_flight(self._observed.flight)


def read(path: AnyPath) -> Log:
    """Read a log.

    Parameters
    ----------
    path : a `.ulg` file, or the folder of a flight that the pipeline saved (`results/save/<flight>`)

    Raises
    ------
    UserError
        There is no such file, or it cannot be read as a log.
    """
    path = Path(path)
    return Log(path, load_flight(path) if path.is_dir() else read_ulog(path))
