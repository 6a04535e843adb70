"""A search that goes on in jobs: what is asked in a round, and what is found in the end.

Each job goes through the rounds before its own again, from the answers that are there, and thinks over only what is
asked next.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from fusetune.apply.ranking import improvement_percent
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.found_sets import FoundSets, found_sets, nothing_found
from fusetune.apply.search.objective import lowest_on_all
from fusetune.apply.search.outcome import Outcome, outcome_rounds
from fusetune.apply.search.plan import plan_of
from fusetune.apply.search.recorded_proposals import RecordedProposals
from fusetune.apply.search.replays import Batch, ReplayGround, Tried
from fusetune.apply.search.requests import Ask
from fusetune.apply.search.round_files import RoundFile, read_round, read_tried
from fusetune.apply.search.rounds import AskedOfFlights, Rounds
from fusetune.apply.search.search_space import search_space
from fusetune.apply.search.searched_flights import SearchedFlights, read_searched_flights
from fusetune.apply.search.space import Space
from fusetune.apply.search.what_matters import WhatMatters, what_matters
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings
from fusetune.errors import RUN_AGAIN, UserError
from fusetune.settings.declaration import built
from fusetune.storage.files import AnyPath


class SearchedSoFar:
    """A search and the answers of its flights so far.

    Parameters
    ----------
    asked : files of the rounds before, of `write_round`
    tried : files of what flights answered to them, of `write_tried`

    Attributes
    ----------
    best : the lowest of what the search on all flights makes small, nat
    """

    def __init__(
        self,
        on: SearchedFlights,
        search: SearchSettings,
        decision: DecisionSettings,
        asked: Iterable[AnyPath],
        tried: Iterable[AnyPath],
    ) -> None:
        self._on, self._search, self._decision = on, search, decision
        self._ground = ReplayGround(_Answers(), decision)
        for file in tried:
            for batch, did in read_tried(file):
                self._ground.know(batch, did)
        self._proposals = RecordedProposals(one for file in asked for one in read_round(file).proposals)
        self.best = 0.0

    @classmethod
    def of_files(
        cls,
        on: AnyPath,
        search: Mapping[str, Any],
        decision: Mapping[str, Any],
        asked: Iterable[AnyPath],
        answers: Sequence[AnyPath],
    ) -> SearchedSoFar:
        """The same from the file of the flights, settings as mappings, and answers as files or folders of rounds."""
        flights = read_searched_flights(on)
        files: list[Path] = []
        for answer in map(Path, answers):
            files += [answer / f"{flight}.json" for flight in flights.flights] if answer.is_dir() else [answer]
        return cls(flights, built(SearchSettings, search), DecisionSettings(**decision), asked, files)

    def asked_in(self, number: int) -> RoundFile:
        """What is asked in a round, from 1; nothing where the search has come to its end before."""
        asks, _ = self._gone_through(number) if self._on.flights else ([], None)
        return RoundFile(number, asks, self._proposals.new)

    def found(self, rounds: int, present_values: Mapping[str, float]) -> tuple[FoundSets, WhatMatters]:
        """What was found, after so many rounds, and what matters; present values as for `found_sets`."""
        if not self._on.flights:
            return nothing_found(self._search, self._on.left_out), WhatMatters(None, None)
        asks, outcome = self._gone_through(rounds + 1)
        if outcome is None:
            raise RuntimeError(f"a search that was to end after {rounds} rounds asks for {len(asks)} comparisons more")
        matters = what_matters(outcome, self._space, self._decision)
        left_out = self._on.left_out
        return found_sets(outcome, self._space, self._search, left_out, present_values, matters.sentences), matters

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
        self.best = min(self.best, lowest_on_all(asks, answers))
        return answers


class _Answers:
    """Replays nothing: all that a search asked before has its answer."""

    def try_batches(self, batches: Sequence[Batch]) -> Iterable[tuple[Batch, Tried]]:
        for flight, _, _ in batches:
            raise UserError(f"results/search/tried of {flight}", "lacks sets that were asked for", RUN_AGAIN)
        return ()
