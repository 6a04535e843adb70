"""The delays of a saved flight: the present set is replayed, its files kept, and the delays written beside them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from fusetune.analyze.delays.sensor_delays import sensor_delays
from fusetune.analyze.flight_files import DELAYS_FILE
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, prepare_flight
from fusetune.analyze.replaying.replay_flight import write_replay
from fusetune.analyze.replaying.samples import SampleSpool
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import PRESENT
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path


def write_delays(
    flight_folder: AnyPath,
    output_folder: AnyPath,
    replayed: Mapping[str, Mapping[str, float]],
    settings: ReplaySettings = IN_USE,
) -> None:
    """Replay the present set where it is out of date, and write `delays.json`.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    output_folder : `results/analyze/<flight>`; takes the replay, or holds it already
    replayed : the present set and its overrides of the log's own parameters; empty where its files are up to date
    """
    folder = Path(output_folder)
    prepared = prepare_flight(load_flight(flight_folder, topics=REPLAY_TOPICS), settings)
    for name, overrides in replayed.items():
        write_replay(prepared, name, overrides, folder)
    found = sensor_delays(prepared, read_set(folder, PRESENT, SampleSpool(folder)))
    with atomic_path(folder / DELAYS_FILE) as temporary:
        write_document(temporary, {"flight": prepared.flight.name, "delays": [one.document() for one in found]})
