"""What flights answer to a round of a search, as a job.

What was tried is kept by flight beside the job's own files, for one that is started again, for other flights or another
budget, may ask for much of it once more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.analyze.trials.tried_flight import TrialSettings
from fusetune.apply.search.kept_pairs import KeptPairs
from fusetune.apply.search.replays import Batch, ReplayGround, Tried
from fusetune.apply.search.round_files import RoundFile, write_tried
from fusetune.apply.search.trial_keys import made_of, trial_settings
from fusetune.apply.search.workers import FlightTrier, WorkerTrier
from fusetune.apply.settings import DecisionSettings
from fusetune.storage.files import AnyPath

_FEWEST_FOR_A_PROCESS = 24
"""Sets on flights for which another process is started: that takes about as long as to replay so many."""

_MANY = 2
"""With so many flights for each process, these have a flight at a time and are done at about the same time."""


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
    pairs_kept = KeptPairs(kept, made_of(folders, trials))
    ground = ReplayGround(_LateTrier(folders, trials, processes), decision, pairs_kept.keep)
    asks = [(own, ask) for flights, ask in asked.asks if (own := tuple(name for name in flights if name in folders))]
    if asks:
        for batch, did in pairs_kept.kept():
            ground.know(batch, did)
    pairs = ground.pairs(asks)
    for name, file in tried.items():
        own_pairs = [one for one in pairs if one[0][0] == name]
        write_tried(file, name, own_pairs)
        yield f"{name}: {sum(len(batch[2]) for batch, _ in own_pairs)} sets"
    yield f"replayed: {ground.replayed}"


class _LateTrier:
    """Starts its processes when there is something to replay, and ends them after it; none where one is enough."""

    def __init__(self, folders: Mapping[str, AnyPath], settings: TrialSettings, processes: int) -> None:
        self._folders, self._settings, self._processes = folders, settings, processes

    def try_batches(self, batches: Sequence[Batch]) -> Iterator[tuple[Batch, Tried]]:
        sets = sum(len(batch[2]) for batch in batches)
        processes = min(self._processes, sets // _FEWEST_FOR_A_PROCESS)
        if processes <= 1:
            yield from FlightTrier(self._folders, self._settings).try_batches(batches)
            return
        trier = WorkerTrier(self._folders, self._settings, processes)
        try:
            flights = len({batch[0] for batch in batches})
            many = flights >= _MANY * processes
            yield from trier.try_flight_by_flight(batches) if many else trier.try_batches(batches)
        finally:
            trier.close()
