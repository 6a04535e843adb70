"""The judge's four figures of a set on a flight, in memory; every pair of flight and set is replayed once."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from benchmarks.decision_study.collect import stamp
from benchmarks.decision_study.world import TRUTH

from fusetune.analyze.flight.ground_truth import Truth, read_truth
from fusetune.analyze.flight.phases import airborne_intervals, imu_gaps
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, PreparedFlight, prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.scoring.metrics_table import MetricsTable, add_true_errors
from fusetune.analyze.scoring.score_sets import SCORE_TOPICS
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.true_errors import Reference, true_errors
from fusetune.analyze.scoring.window import ScoringWindow, scoring_window
from fusetune.analyze.scoring.withheld_scores import add_true_drift
from fusetune.px4.parameters.ekf2_parameters import as_float32
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import PRESENT
from fusetune.storage.digest import source_digest

FIGURES = tuple(TRUTH)
"""Velocity (m/s), attitude (°), position less its mean (m), drift in the gaps without GNSS (m): RMSE."""

Array = npt.NDArray[np.float64]


class JudgedFlight:
    """A flight with its truth, loaded when the first set is replayed on it."""

    def __init__(self, folder: Path, settings: ReplaySettings) -> None:
        self.folder, self._settings, self._scoring = folder, settings, ScoringSettings()

    @property
    def name(self) -> str:
        """World, flight, and what it was made from: a flight that is flown otherwise is another."""
        return f"{self.folder.parent.name}_{self.folder.name}_{stamp(self.folder).read_text(encoding='utf-8')[:8]}"

    @cached_property
    def prepared(self) -> PreparedFlight:
        """The flight as it is replayed, with all topics that scores need."""
        topics = tuple(dict.fromkeys((*REPLAY_TOPICS, *SCORE_TOPICS)))
        return prepare_flight(load_flight(self.folder, topics=topics), self._settings)

    @cached_property
    def _truth(self) -> Truth:
        truth = read_truth(self.prepared.flight)
        assert truth is not None, self.folder
        return truth

    @cached_property
    def _window(self) -> ScoringWindow:
        """As `score_sets` has it: the present set's."""
        present, flight = replay_set(self.prepared, PRESENT, {}), self.prepared.flight
        gaps = imu_gaps(flight, self._scoring.log_gap_s)
        return scoring_window(present, airborne_intervals(flight, present.flags), gaps, self._scoring)

    def figures(self, overrides: Mapping[str, float]) -> Array:
        """(4,) `FIGURES` of a set; NaN where it has none, as of a set that diverges."""
        record = replay_set(self.prepared, "judged", overrides)
        if record.status != "ok" or not self._window.intervals:
            return np.full(len(FIGURES), np.nan)
        table = MetricsTable(self.prepared.flight.name)
        errors = true_errors(record, record.states(), Reference(self._truth), self._window, self._scoring.confidence)
        add_true_errors(table, record.name, errors)
        add_true_drift(table, record, self._truth, self._window)
        rows = {
            (row["source"], row["axis"]): row["value"]
            for row in table.finished().to_pylist()
            if row["metric"] == "rmse"
        }
        return np.array([rows.get(key, np.nan) for key in TRUTH.values()])


def set_key(overrides: Mapping[str, float]) -> str:
    """A set as a key: its values as the float32 that PX4 holds, whatever their order."""
    return json.dumps({name: as_float32(overrides[name]) for name in sorted(overrides)})


class KeptFigures:
    """Figures of sets on flights, each pair computed once and kept in a file of its flight."""

    def __init__(self, folder: Path, flights: Sequence[JudgedFlight]) -> None:
        """Figures of other sources of the estimator and of its judging are not these: they are kept apart."""
        digest = source_digest("px4", "ekf2", "analyze/replaying", "analyze/flight", "analyze/scoring/window.py")
        self.flights = tuple(flights)
        self._files = [folder / digest[:12] / f"{one.name}.jsonl" for one in flights]
        self._known = [self._read(file) for file in self._files]

    @staticmethod
    def _read(file: Path) -> dict[str, Array]:
        """What the file holds; a line that was being written when the computer stopped is left out."""
        known: dict[str, Array] = {}
        for line in file.read_text(encoding="utf-8").splitlines() if file.is_file() else ():
            try:
                key, values = json.loads(line)
            except json.JSONDecodeError:
                continue
            known[key] = np.array(values, dtype=np.float64)
        return known

    def figures(self, overrides: Mapping[str, float], flights: Sequence[int] | None = None) -> Array:
        """(F, 4) figures of a set on some flights, by default all."""
        numbers = range(len(self.flights)) if flights is None else flights
        return np.array([self._one(number, overrides) for number in numbers])

    def _one(self, number: int, overrides: Mapping[str, float]) -> Array:
        key, known = set_key(overrides), self._known[number]
        if key not in known:
            known[key] = self.flights[number].figures(overrides)
            self._files[number].parent.mkdir(parents=True, exist_ok=True)
            with self._files[number].open("a", encoding="utf-8") as file:
                # A line begins with its end of line: what was torn before it stays a line of its own.
                file.write("\n" + json.dumps([key, known[key].tolist()]))
        return known[key]
