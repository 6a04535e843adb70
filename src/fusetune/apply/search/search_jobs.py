"""A search as jobs: what is asked in a round, what flights answer to it, what is found in the end.

Each job goes through the rounds before its own again, from the answers that are there, and thinks over only what is
asked next. What was tried is kept by flight beside the jobs' own files, for a job that is started again, for other
flights or another budget, may ask for much of it once more.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.analyze.trials.tried_flight import TrialSettings
from fusetune.apply.ranking import improvement_percent
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.found_sets import FoundSets, found_sets, nothing_found
from fusetune.apply.search.kept_pairs import KeptPairs
from fusetune.apply.search.objective import objective
from fusetune.apply.search.outcome import Outcome, outcome_rounds
from fusetune.apply.search.plan import plan_of
from fusetune.apply.search.recorded_proposals import RecordedProposals
from fusetune.apply.search.replays import Batch, ReplayGround, Tried
from fusetune.apply.search.requests import Ask
from fusetune.apply.search.round_files import RoundFile, read_round, read_tried, write_tried
from fusetune.apply.search.rounds import AskedOfFlights, Rounds
from fusetune.apply.search.search_space import search_space
from fusetune.apply.search.searched_flights import SearchedFlights
from fusetune.apply.search.space import Space
from fusetune.apply.search.trial_keys import made_of, trial_settings
from fusetune.apply.search.workers import FlightTrier, WorkerTrier
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings
from fusetune.errors import RUN_AGAIN, UserError
from fusetune.storage.files import AnyPath

_FEWEST_FOR_A_PROCESS = 24
"""Sets on flights for which another process is started: that takes about as long as to replay so many."""


def tried_files(answers: Sequence[AnyPath], flights: Sequence[str]) -> list[Path]:
    """Files of what flights answered: given themselves, or the folders of their rounds."""
    paths = [Path(one) for one in answers]
    return [
        file
        for path in paths
        for file in ([path / f"{flight}.json" for flight in flights] if path.is_dir() else [path])
    ]


class SearchedSoFar:
    """A search and the answers of its flights so far.

    Parameters
    ----------
    asked : files of the rounds before, of `write_round`
    tried : files of what flights answered to them, of `write_tried`
    """

    def __init__(
        self,
        on: SearchedFlights,
        search: SearchSettings,
        decision: DecisionSettings,
        asked: Iterable[AnyPath],
        tried: Iterable[AnyPath],
    ) -> None:
        self._on, self._search = on, search
        self._ground = ReplayGround(_Answers(), decision)
        for file in tried:
            for batch, did in read_tried(file):
                self._ground.know(batch, did)
        self._proposals = RecordedProposals(one for file in asked for one in read_round(file).proposals)
        self.best = 0.0
        """The lowest of what the search on all flights makes small, nat."""

    def asked_in(self, number: int) -> RoundFile:
        """What is asked in a round, from 1; nothing where the search has come to its end before."""
        asks, _ = self._gone_through(number) if self._on.flights else ([], None)
        return RoundFile(number, asks, self._proposals.new)

    def found(self, rounds: int, present_values: Mapping[str, float]) -> FoundSets:
        """What was found, after so many rounds; present values as for `found_sets`."""
        if not self._on.flights:
            return nothing_found(self._search, self._on.left_out)
        asks, outcome = self._gone_through(rounds + 1)
        if outcome is None:
            raise RuntimeError(f"a search that was to end after {rounds} rounds asks for {len(asks)} comparisons more")
        return found_sets(outcome, self._space, self._search, self._on.left_out, present_values)

    def told(self, asked: RoundFile) -> str:
        """How far the search is, in a line."""
        planned = len(plan_of(self._space, self._search).rounds) if self._on.flights else 0
        sets = sum(len(ask.sets) * len(flights) for flights, ask in asked.asks)
        gain = f"; errors {improvement_percent(self.best):.1f} % smaller so far" if self.best < 0.0 else ""
        stages = ", ".join(dict.fromkeys(ask.stage for _, ask in asked.asks))
        what = f"{sets} sets on flights ({stages})" if sets else "nothing more to try"
        return f"round {asked.number} of {planned + 1}: {what}{gain}"

    @cached_property
    def _space(self) -> Space:
        return search_space(self._on.vehicle, self._on.parameters, self._search)

    def _gone_through(self, number: int) -> tuple[Sequence[AskedOfFlights], Outcome | None]:
        """What is asked in a round, or the outcome where the search ends before."""
        rounds: Rounds[Outcome] = outcome_rounds(self._on.flights, self._space, self._search, self._proposals)
        asks = next(rounds)
        for _ in range(number - 1):
            try:
                asks = rounds.send(self._compared(asks))
            except StopIteration as ended:
                return [], ended.value
        return asks, None

    def _compared(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        answers = self._ground.compare(asks)
        scores = objective(answers[0], asks[0][1].stage)
        self.best = min(self.best, float(scores.min()) if scores.size else 0.0)
        return answers


class _Answers:
    """Replays nothing: all that a search asked before has its answer."""

    def try_batches(self, batches: Sequence[Batch]) -> Iterable[tuple[Batch, Tried]]:
        for flight, _, _ in batches:
            raise UserError(f"results/search/tried of {flight}", "lacks sets that were asked for", RUN_AGAIN)
        return ()


def try_round(
    asked: RoundFile,
    folders: Mapping[str, AnyPath],
    tried: Mapping[str, AnyPath],
    kept: AnyPath,
    decision: DecisionSettings,
    analysis: AnalysisSettings,
    processes: int,
) -> Iterator[str]:
    """Replay what is asked of some flights in a round, and write what their sets did.

    Parameters
    ----------
    folders : of the saved flights
    tried : of each, the file that is written
    kept : folder of all that was ever tried

    Yields
    ------
    For each flight, how many sets there are, in words; when all are tried
    """
    trials = trial_settings(decision, analysis)
    named = {name: str(Path(folder)) for name, folder in folders.items()}
    keys = made_of(folders, trials)
    ground = ReplayGround(_LateTrier(named, trials, processes), decision, KeptPairs(kept, keys).keep)
    asks = [(own, ask) for flights, ask in asked.asks if (own := tuple(name for name in flights if name in folders))]
    if asks:
        for batch, did in KeptPairs(kept, keys).kept():
            ground.know(batch, did)
    pairs = ground.pairs(asks)
    for name, file in tried.items():
        own_pairs = [one for one in pairs if one[0][0] == name]
        write_tried(file, name, own_pairs)
        yield f"{name}: {sum(len(batch[2]) for batch, _ in own_pairs)} sets"
    yield f"replayed: {ground.replayed}"


class _LateTrier:
    """Starts its processes when there is something to replay, and ends them after it; none where one is enough."""

    def __init__(self, folders: Mapping[str, str], settings: TrialSettings, processes: int) -> None:
        self._folders, self._settings, self._processes = folders, settings, processes

    def try_batches(self, batches: Sequence[Batch]) -> Iterator[tuple[Batch, Tried]]:
        sets = sum(len(batch[2]) for batch in batches)
        processes = min(self._processes, sets // _FEWEST_FOR_A_PROCESS)
        if processes <= 1:
            yield from FlightTrier(self._folders, self._settings).try_batches(batches)
            return
        trier = WorkerTrier(self._folders, self._settings, processes)
        try:
            yield from trier.try_batches(batches)
        finally:
            trier.close()
