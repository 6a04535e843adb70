"""The sets of a flight replayed and scored in memory where their scores are not kept, and the scores of all written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from fusetune.analyze.flight_files import KEPT_SCORES_FILE
from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.replaying.replay_flight import replay_set, write_replay
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import SampleSpool
from fusetune.analyze.replaying.store.parts import summary_file
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.kept_scores import kept_scores
from fusetune.analyze.scoring.score_flight import scores_writer
from fusetune.analyze.scoring.set_scores import SetScores, score_flight, score_together
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.yardstick import WITH_MEASURED_ANTENNA, ScoredFlight, Yardstick
from fusetune.ekf2.replay.recording import FULL, TRACED, Recording
from fusetune.set_names import ONBOARD
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.freed_memory import give_back_freed_memory
from fusetune.storage.ledger import key_of

MOST_TOGETHER = 16
"""Sets that are scored at once: of more the figures of each cost no less."""

SCRATCH_PREFIX = ".scoring-"
"""Of folders for the replays of longer ones."""


class SavedFlight(Protocol):
    """What is needed of the flight when a set is to be replayed or scored."""

    @property
    def prepared(self) -> PreparedFlight: ...

    def scored_flight(self) -> ScoredFlight: ...

    def forget_schedules(self) -> None: ...


@dataclass(frozen=True)
class SetsToScore:
    """Sets that are scored on a flight.

    Attributes
    ----------
    present : name of the set that the others are compared with, whose replay is in the store
    sets : name of each, that one among them → its overrides of the log's own parameters; None of a set whose replay is
        in the store as well
    made_of : what all scores follow from, as JSON can hold it; None where none are kept
    """

    present: str
    sets: Mapping[str, Mapping[str, float] | None]
    made_of: Any

    def keys(self, folder: AnyPath) -> dict[str, str]:
        """What the scores of each set follow from, as a key."""
        antenna = {name: self._values(folder, name) for name in WITH_MEASURED_ANTENNA if name in self.sets}
        common = key_of([self.made_of, self.present, self._values(folder, self.present), antenna])
        return {name: key_of([common, name, self._values(folder, name)]) for name in self.sets}

    def _values(self, folder: AnyPath, name: str) -> Any:
        values = None if name == self.present else self.sets[name]
        if values is not None:
            return dict(values)
        summary = read_document(summary_file(folder, name), sealed=False)
        return [summary["params"], summary["overrides"]]


def write_scores(
    asked: SetsToScore, folder: AnyPath, flight: SavedFlight, settings: ScoringSettings, threads: int = 1
) -> tuple[str, ...]:
    """Write the scores of all sets of a flight; those that are kept and still true are not made again.

    Parameters
    ----------
    folder : `results/analyze/<flight>`
    threads : sets that are replayed and scored at a time

    Returns
    -------
    Names of the sets that were scored now
    """
    keys = asked.keys(folder)
    path = None if asked.made_of is None else Path(folder) / KEPT_SCORES_FILE
    with kept_scores(path) as kept:
        outdated = [name for name, key in keys.items() if not kept.has(key)]
        itself = key_of([keys[asked.present], ONBOARD])
        if outdated or not kept.has(itself):
            at_work = _SetsAtWork(asked, folder, flight, settings)
            kept.keep({itself: score_flight(at_work.yardstick)})
            for scores in at_work.scores(outdated, threads):
                kept.keep({keys[name]: one for name, one in scores.items()})
        with scores_writer(folder) as writer:
            for name, key in keys.items():
                writer.take(name, kept.scores(key))
            writer.finish(kept.scores(itself))
        kept.drop_others({*keys.values(), itself})
    return tuple(outdated)


class _SetsAtWork:
    """Replays and scores the sets of a flight."""

    def __init__(self, asked: SetsToScore, folder: AnyPath, flight: SavedFlight, settings: ScoringSettings) -> None:
        self._asked, self._folder, self._flight, self._settings = asked, Path(folder), flight, settings
        self._spool = SampleSpool(folder)

    @cached_property
    def _antenna(self) -> ReplayedSet | None:
        """The set that the smoothed velocity is made of where there is one: that takes its IMU steps, too."""
        name = next((one for one in WITH_MEASURED_ANTENNA if one in self._asked.sets), None)
        return None if name is None else self._replayed(name, FULL)

    @cached_property
    def yardstick(self) -> Yardstick:
        """What all are measured with."""
        scored = self._flight.scored_flight()
        present = read_set(self._folder, self._asked.present, self._spool)
        return Yardstick(scored, present, self._settings, self._antenna)

    def scores(self, names: Sequence[str], threads: int) -> Iterator[dict[str, SetScores]]:
        """Scores of some sets in their order, of as many at once as are scored together."""
        self.yardstick.make()
        give_back_freed_memory()
        # each thread has its share
        most = max(1, min(self._flight.prepared.sets_at_once, MOST_TOGETHER, len(names) // threads))
        parts = [names[first : first + most] for first in range(0, len(names), most)]
        if threads <= 1:
            for part in parts:
                yield self._scores(part, alone=True)
            return
        with ThreadPoolExecutor(threads) as pool:
            yield from pool.map(self._scores, parts)

    def _scores(self, names: Sequence[str], alone: bool = False) -> dict[str, SetScores]:
        # of small ones the next need the same memory again
        is_large = self._flight.prepared.sets_at_once == 1
        with ExitStack() as records:
            replayed = [records.enter_context(self._record(name)) for name in names]
            if alone and is_large:
                # where several are at work the others may be replayed with them
                self._flight.forget_schedules()
                give_back_freed_memory()
            scores = score_together(self.yardstick, replayed)
            del replayed
        if is_large:
            give_back_freed_memory()
        return dict(zip(names, scores, strict=True))

    @contextmanager
    def _record(self, name: str) -> Iterator[ReplayedSet]:
        present, recording, overrides = self.yardstick.present, self.yardstick.recording, self._asked.sets[name]
        if name == present.name:
            yield present
        elif self._antenna is not None and name == self._antenna.name:
            yield self._antenna
        elif overrides is not None and recording is TRACED and self._flight.prepared.is_long:
            with TemporaryDirectory(prefix=SCRATCH_PREFIX, dir=self._folder) as scratch:
                write_replay(self._flight.prepared, name, overrides, scratch)
                yield read_set(scratch, name)
        else:
            yield self._replayed(name, recording)

    def _replayed(self, name: str, recording: Recording) -> ReplayedSet:
        overrides = self._asked.sets[name]
        if overrides is None:
            return read_set(self._folder, name, self._spool)
        return replay_set(self._flight.prepared, name, overrides, recording)
