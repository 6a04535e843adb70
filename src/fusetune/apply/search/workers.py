"""Processes that try sets on flights; the same figures come from any number of them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import as_completed

from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.trials.tried_flight import TrialSettings, TriedFlight, prepare_trials
from fusetune.apply.search.comparison import TriedBase
from fusetune.apply.search.replays import Batch, Tried, tells_place
from fusetune.apply.search.requests import Values
from fusetune.running.worker_processes import worker_processes
from fusetune.storage.files import AnyPath

_MOST_PREPARED = 12
"""Flights that a process holds; one of a minute takes about 30 MB."""

_MOST_BASES = 3
"""Of each of these."""


class FlightTrier:
    """Tries sets on saved flights in this process.

    Parameters
    ----------
    folders : of the saved flights, by name
    """

    def __init__(self, folders: Mapping[str, AnyPath], settings: TrialSettings) -> None:
        self._folders, self._settings = dict(folders), settings
        self._flights: OrderedDict[str, tuple[PreparedFlight, OrderedDict[Values, TriedFlight]]] = OrderedDict()

    def try_batches(self, batches: Sequence[Batch]) -> Iterator[tuple[Batch, Tried]]:
        """What the sets of each batch did, one after the other."""
        for batch in batches:
            yield batch, self.try_batch(batch)

    def try_batch(self, batch: Batch) -> Tried:
        """What the sets of a batch did."""
        name, base, sets = batch
        flight = self._flight(name, base)
        place = flight.place if tells_place(batch) else None
        about = TriedBase(flight.reason, flight.whiteness, flight.base_set, place)
        return about, tuple(flight.base_set if one == base else flight.try_set(dict(one)) for one in sets)

    def _flight(self, name: str, base: Values) -> TriedFlight:
        if name not in self._flights:
            self._flights[name] = prepare_trials(self._folders[name], self._settings), OrderedDict()
        self._flights.move_to_end(name)
        prepared, bases = self._flights[name]
        if base not in bases:
            bases[base] = TriedFlight(prepared, dict(base), self._settings)
        bases.move_to_end(base)
        while len(bases) > _MOST_BASES:
            bases.popitem(last=False)
        while len(self._flights) > _MOST_PREPARED:
            self._flights.popitem(last=False)
        return bases[base]


class WorkerTrier:
    """Tries sets on saved flights in processes of its own; to be closed."""

    def __init__(self, folders: Mapping[str, AnyPath], settings: TrialSettings, processes: int) -> None:
        self.pool = worker_processes(processes, _begin, dict(folders), settings)
        """Its processes, for whatever else they may do."""

    def try_batches(self, batches: Sequence[Batch]) -> Iterator[tuple[Batch, Tried]]:
        """What the sets of each batch did, as it comes."""
        return self._tried([[batch] for batch in batches])

    def try_flight_by_flight(self, batches: Sequence[Batch]) -> Iterator[tuple[Batch, Tried]]:
        """The same, a flight a process, which need not be prepared by others then; it comes when the flight is done."""
        flights: dict[str, list[Batch]] = {}
        for batch in batches:
            flights.setdefault(batch[0], []).append(batch)
        return self._tried(list(flights.values()))

    def _tried(self, groups: Sequence[Sequence[Batch]]) -> Iterator[tuple[Batch, Tried]]:
        running = [self.pool.submit(_try_batches, group) for group in groups]
        try:
            for one in as_completed(running):
                yield from one.result()
        finally:
            for one in running:
                one.cancel()

    def close(self) -> None:
        """End the processes."""
        self.pool.shutdown(cancel_futures=True)


_of_this_process: list[FlightTrier] = []


def _begin(folders: Mapping[str, AnyPath], settings: TrialSettings) -> None:
    _of_this_process[:] = [FlightTrier(folders, settings)]


def _try_batches(batches: Sequence[Batch]) -> list[tuple[Batch, Tried]]:
    return list(_of_this_process[0].try_batches(batches))
