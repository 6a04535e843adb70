"""All that the pipeline makes of one saved flight: replays of the parameter sets, their scores, and how far they can be
trusted.

One process does it all, for its start, the reading of the flight and its reconstruction together take longer than the
work itself. Of the present set and of the parameters that flew all of the replay is written; of any other set it is
scored in memory, and the scores are kept (`scored_sets`). Each step adds what it reads of the log, and what no later
one reads leaves the memory, so that this is that of the largest step.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from fusetune.analyze.flight_files import FIDELITY_FILE, ONBOARD_FILE
from fusetune.analyze.replaying.onboard import onboard_samples, with_onboard_columns, write_onboard
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, PreparedFlight, prepare_flight
from fusetune.analyze.replaying.replay_flight import copy_replay, write_replay
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.analyze.replaying.store.ledger import ReplayLedger
from fusetune.analyze.replaying.store.parts import replay_files, summary_file
from fusetune.analyze.scored_sets import SetsToScore, write_scores
from fusetune.analyze.scoring.score_flight import read_onboard
from fusetune.analyze.scoring.score_sets import SCORE_TOPICS, ScoredFlight, scored_flight
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.trust.as_flown_comparison import AsFlownComparison, AsFlownReplay
from fusetune.analyze.trust.as_flown_figures import compared_rows
from fusetune.analyze.trust.grade import COMPARED_SOURCES, TRUST_TOPICS, TrustGrade, grade_flight
from fusetune.analyze.trust.onboard_fidelity import write_flight_fidelity
from fusetune.analyze.trust.settings import TrustSettings
from fusetune.ekf2.replay.kept_rows import KeptRows
from fusetune.ekf2.replay.replay import result_of
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight, read_metadata
from fusetune.set_names import AS_FLOWN, PRESENT
from fusetune.storage.files import AnyPath
from fusetune.storage.freed_memory import give_back_freed_memory
from fusetune.storage.ledger import Ledger, key_of

COMPARED_TOPICS = (
    *(topic for topic in TRUST_TOPICS if topic not in REPLAY_TOPICS),
    "estimator_selector_status",
    "estimator_status",
)
"""What is read of a saved flight when the sets have been replayed, with what its canonical form depends on."""

REFERENCE_TOPICS = tuple(topic for topic in SCORE_TOPICS if topic not in (*REPLAY_TOPICS, *COMPARED_TOPICS))
"""What is read of it when it has been graded."""

_GRADE_LEDGER = ".fidelity.made.json"


@dataclass(frozen=True)
class AnalysisSettings:
    """How a flight is replayed, scored and graded."""

    replay: ReplaySettings = IN_USE
    scoring: ScoringSettings = field(default_factory=ScoringSettings)
    trust: TrustSettings = field(default_factory=TrustSettings)


@dataclass(frozen=True)
class MadeWith:
    """State of the sources that replays, and scores and grade, follow from, as JSON can hold it."""

    replay: Any
    scores: Any


def analyze_flight(
    flight_folder: AnyPath,
    output_folder: AnyPath,
    replayed: Mapping[str, Mapping[str, float]],
    scored: Sequence[str],
    *,
    present: str = PRESENT,
    settings: AnalysisSettings | None = None,
    made_with: MadeWith | None = None,
    threads: int = 1,
) -> tuple[str, ...]:
    """Replay some sets on a saved flight, then grade the flight and score all sets.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    output_folder : `results/analyze/<flight>`; takes the replays of the present set and of those that flew, the scores
        and the grade. Of sets that are scored but not replayed here, as the present one may be, it holds the replays.
    replayed : name of each set → its overrides of the log's own parameters
    scored : names of all sets, the present one among them or added
    made_with : what was made of the same log, settings, values and sources before is not made again; by default all is,
        and no scores are kept
    threads : sets that are replayed and scored at a time

    Returns
    -------
    The sets that were replayed or scored: the others were up to date.

    Raises
    ------
    UserError
        If the saved flight, or a file of a replay made before, is missing or damaged.
    """
    settings = settings or AnalysisSettings()
    work = _FlightAtWork(flight_folder, output_folder, settings, made_with)
    written = work.write_replays({name: replayed[name] for name in (present, AS_FLOWN) if name in replayed})
    _drop_replays(output_folder, {*replayed} - {present, AS_FLOWN})
    work.write_grade(anew=AS_FLOWN in written)
    sets = {name: replayed.get(name) for name in dict.fromkeys((present, *scored))}
    made = write_scores(
        SetsToScore(present, sets, work.scores_made_of()), output_folder, work, settings.scoring, threads
    )
    return tuple(dict.fromkeys((*written, *made)))


def _drop_replays(folder: AnyPath, names: Collection[str]) -> None:
    """Remove the files of replays that are not written any more, which an earlier version left."""
    there = {file.name for file in Path(folder).iterdir()}
    for name in names:
        if summary_file(folder, name).name in there:
            for file in replay_files(folder, name):
                file.unlink(missing_ok=True)


class _FlightAtWork:
    """A saved flight; its parts are read and made when they are first needed."""

    def __init__(
        self, flight_folder: AnyPath, output_folder: AnyPath, settings: AnalysisSettings, made_with: MadeWith | None
    ) -> None:
        self._flight_folder, self._folder = Path(flight_folder), Path(output_folder)
        self._settings, self._made_with = settings, made_with
        self._compared: AsFlownReplay | None = None
        self._folder.mkdir(parents=True, exist_ok=True)

    @cached_property
    def prepared(self) -> PreparedFlight:
        """What all replays share."""
        return prepare_flight(load_flight(self._flight_folder, topics=REPLAY_TOPICS), self._settings.replay)

    @cached_property
    def compared(self) -> PreparedFlight:
        """The same with what the vehicle's own estimator logged."""
        flight = self.prepared.flight.with_more(canonical(load_flight(self._flight_folder, topics=COMPARED_TOPICS)))
        return self.prepared.with_flight(flight)

    def scored_flight(self) -> ScoredFlight:
        """What scores need of the flight; the grade must be written."""
        self.forget_schedules()
        give_back_freed_memory()
        flight = self.compared.flight.with_more(canonical(load_flight(self._flight_folder, topics=REFERENCE_TOPICS)))
        onboard = self._folder / ONBOARD_FILE
        if not onboard.exists():
            write_onboard(onboard, onboard_samples(flight))
        scored = scored_flight(flight, self._settings.scoring, read_onboard(self._folder))
        # what is left of the log the replays of the other sets do not read
        del self.compared
        self.prepared = self.prepared.for_replays_alone()
        give_back_freed_memory()
        return scored

    def forget_schedules(self) -> None:
        """Of a long flight, let go what its replays share: to work it out anew takes a tenth of a replay."""
        if self.prepared.is_long:
            self.prepared = self.prepared.without_schedules()
            if "compared" in self.__dict__:
                self.compared = self.prepared.with_flight(self.compared.flight)

    def scores_made_of(self) -> Any:
        """What the scores of any set follow from; None where they are not to be kept."""
        if self._made_with is None:
            return None
        settings = [asdict(self._settings.replay), asdict(self._settings.scoring)]
        return [self._checksum, self._made_with.replay, self._made_with.scores, *settings]

    def write_replays(self, sets: Mapping[str, Mapping[str, float]]) -> tuple[str, ...]:
        """Replay sets and write their files, where these are not up to date.

        Returns
        -------
        Their names
        """
        ledger = self._replay_ledger()
        outdated = sets if ledger is None else ledger.outdated(sets)
        for name, overrides in outdated.items():
            twin = next((one for one in sets if one != name and self._are_one(sets[one], overrides)), None)
            if name == AS_FLOWN and twin is not None:
                copy_replay(self.prepared, self._folder, twin, name, overrides)
            elif name == AS_FLOWN:
                self._compared = self._write_as_flown()
            else:
                write_replay(self.prepared, name, overrides, self._folder)
        if ledger is not None:
            ledger.record(outdated)
        return tuple(outdated)

    def write_grade(self, *, anew: bool) -> None:
        """Compare the parameters that flew with the vehicle and write the grade, where it is not up to date.

        Parameters
        ----------
        anew : whether it is not in any case, as the replay of what flew is new
        """
        files = [self._folder / FIDELITY_FILE, self._folder / ONBOARD_FILE]
        ledger = Ledger(self._folder / _GRADE_LEDGER)
        key = key_of([self.scores_made_of(), asdict(self._settings.trust)])
        if self._made_with is not None and not anew and ledger.is_current(AS_FLOWN, key, files):
            return
        self.forget_schedules()
        flight = self.compared.flight
        give_back_freed_memory()
        write_onboard(self._folder / ONBOARD_FILE, onboard_samples(flight))
        flight = with_onboard_columns(flight, COMPARED_SOURCES)
        self.compared = prepared = self.compared.with_flight(flight)
        give_back_freed_memory()
        comparison = AsFlownComparison(flight, self._settings.trust)
        if self._compared is not None:
            # the grade finds these figures made; the replay itself need not stay
            comparison.figures(prepared, self._compared)
            self._compared = None
        grade = grade_flight(prepared, self._settings.replay, self._settings.trust, comparison)
        write_flight_fidelity(prepared, self._folder, grade)
        if self._made_with is not None:
            ledger.record(AS_FLOWN, key, files)

    @cached_property
    def _checksum(self) -> str:
        return str(read_metadata(self._flight_folder)["checksum"])

    def _replay_ledger(self) -> ReplayLedger | None:
        if self._made_with is None:
            return None
        made_with = [self._made_with.replay, asdict(self._settings.replay)]
        return ReplayLedger(self._flight_folder, self._folder, made_with)

    def _are_one(self, one: Mapping[str, float], other: Mapping[str, float]) -> bool:
        return self.prepared.course_of(one) == self.prepared.course_of(other)

    def _write_as_flown(self) -> AsFlownReplay:
        """Replay the parameters that flew and write their files; what the grade compares of the replay."""
        kept = KeptRows(compared_rows(onboard_samples(self.compared.flight)))
        summary = write_replay(self.prepared, AS_FLOWN, {}, self._folder, also=kept.take)
        result = result_of(summary, kept.rows())
        return AsFlownReplay(result, self.prepared.measured(result.innovations, self.prepared.parameters({}), result))


def grade_saved_flight(flight_folder: AnyPath, settings: AnalysisSettings) -> TrustGrade:
    """Grade a saved flight as `analyze_flight` does, without what the causes cost; nothing is written.

    Raises
    ------
    UserError
        If the saved flight is missing or damaged.
    """
    flight = canonical(load_flight(flight_folder, topics={*REPLAY_TOPICS, *COMPARED_TOPICS}))
    prepared = prepare_flight(flight, settings.replay).with_flight(with_onboard_columns(flight, COMPARED_SOURCES))
    return grade_flight(prepared, settings.replay, replace(settings.trust, causes=False))
