"""All that is told of a saved flight before any set is compared: health, effects, noise and delays of sensors, causes.

One process does it all: flight, replay and motion are shared. A flight that cannot be replayed is asked as well, and of
a log that could not be read there is nothing to tell.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from fusetune.analyze.conformance.flown_track import FlownTrack, flown_track
from fusetune.analyze.conformance.smoothed_track import smoothed_track
from fusetune.analyze.conformance.track_file import write_track
from fusetune.analyze.diagnosis.diagnose import diagnose
from fusetune.analyze.diagnosis.diagnosis import Diagnosis
from fusetune.analyze.effects.all_effects import FlightEffects
from fusetune.analyze.effects.effect_files import effects_document
from fusetune.analyze.flight.reference_truth import GROUND_TRUTH_TOPICS
from fusetune.analyze.flight_files import (
    DELAYS_FILE,
    DIAGNOSIS_FILE,
    EFFECTS_FILE,
    HEALTH_FILE,
    SENSOR_NOISE_FILE,
    TRACK_FILE,
)
from fusetune.analyze.health.health_files import health_document
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.health_table import DEFAULTS, health_rows
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise, sensor_noise
from fusetune.errors import OF_DAMAGE
from fusetune.finding import from_documents, of_severity
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.used_topics import is_used
from fusetune.save.flight_folder import METADATA_FILE, load_flight, read_flight_document
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.freed_memory import give_back_freed_memory

Told = TypeVar("Told")

REPLAYABLE = "replayable"

SCRATCH_PREFIX = ".replay-"
"""Of a folder beside the results that holds the replay of a long flight while it is read."""


def diagnose_flight(
    flight_folder: AnyPath,
    output_folder: AnyPath,
    *,
    replay: ReplaySettings = IN_USE,
    health: HealthSettings = DEFAULTS,
    present: Mapping[str, float] | None = None,
) -> tuple[Diagnosis, ...]:
    """Write `health.json`, `effects.json`, `sensor_noise.json`, `diagnosis.json` and `track.parquet` of a saved flight.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    output_folder : `results/analyze/<flight>`
    present : values of the present set, with which `delays.json` is written, too; None writes none

    Returns
    -------
    What is wrong, what explains most first

    Raises
    ------
    UserError
        The saved flight is missing or damaged.
    """
    metadata = read_flight_document(Path(flight_folder) / METADATA_FILE)
    is_replayable = metadata["verdict"]["status"] == REPLAYABLE
    used = {entry["topic"] for entry in metadata.get("topics", ()) if is_used(entry["topic"])} - {*GROUND_TRUTH_TOPICS}
    # of a log that could not be read nothing was saved
    logged = load_flight(flight_folder, topics=used) if used else Flight(Path(flight_folder).name)
    Path(output_folder).mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=SCRATCH_PREFIX, dir=output_folder) as scratch:
        observed = _observed(logged, replay, scratch)
        documents, found, track = _told(observed, metadata, health)
        if present is not None:
            if is_replayable and not observed.flew_with(present):
                # two replays at once would be twice the memory
                observed = observed.without_replay()
            documents[DELAYS_FILE] = _delays(observed, present if is_replayable else None)
    _write(Path(output_folder), documents)
    write_track(Path(output_folder) / TRACK_FILE, track)
    return found


def estimate_delays(
    flight_folder: AnyPath,
    output_folder: AnyPath,
    present: Mapping[str, float],
    *,
    replay: ReplaySettings = IN_USE,
) -> None:
    """Write `delays.json` of a saved flight alone, as `diagnose_flight` does with all else.

    Parameters
    ----------
    present : values of the present set

    Raises
    ------
    UserError
        The saved flight is missing or damaged.
    """
    metadata = read_flight_document(Path(flight_folder) / METADATA_FILE)
    is_replayable = metadata["verdict"]["status"] == REPLAYABLE
    logged = load_flight(flight_folder, REPLAY_TOPICS) if is_replayable else Flight(Path(flight_folder).name)
    Path(output_folder).mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=SCRATCH_PREFIX, dir=output_folder) as scratch:
        document = _delays(_observed(logged, replay, scratch), present if is_replayable else None)
    _write(Path(output_folder), {DELAYS_FILE: document})


def _observed(logged: Flight, replay: ReplaySettings, scratch: AnyPath) -> ObservedFlight:
    # nothing here asks what the filter predicts without a sensor, which takes most of a replay's time and memory
    return ObservedFlight(logged, replace(replay, withholding=None), Path(scratch))


def _delays(observed: ObservedFlight, present: Mapping[str, float] | None) -> dict[str, Any]:
    """Delays by a replay of the present set; none without it."""
    found = () if present is None else observed.delays(present)
    return {"flight": observed.logged.name, "delays": [one.document() for one in found]}


def _told(
    observed: ObservedFlight, metadata: Mapping[str, Any], health: HealthSettings
) -> tuple[dict[str, dict[str, Any]], tuple[Diagnosis, ...], FlownTrack | None]:
    """The documents by their files, what is wrong, and the track."""
    logged, is_replayable = observed.logged, metadata["verdict"]["status"] == REPLAYABLE
    name, start_us = logged.name, int(logged.start_timestamp)
    asked = _Asked(is_replayable)
    no_rows: tuple[HealthRow, ...] = ()
    rows = asked.about("health", no_rows, lambda: health_rows(observed, health))
    # before the first replay, which takes much of the memory
    untold = SensorNoise(name, start_us, (), (), {}, (), 0.0)
    noise = asked.about("sensor noise", untold, lambda: sensor_noise(observed.flight, observed.airborne))
    _forget_what_flew(observed)
    tuned = FlightEffects(observed)
    effects = tuned.all() if is_replayable else ()
    nothing: tuple[Diagnosis, ...] = ()
    found = asked.about("diagnosis", nothing, lambda: diagnose(observed, effects=tuned))
    track = asked.about("track", None, lambda: _track(observed, is_replayable))
    documents = {
        HEALTH_FILE: health_document(logged, rows, replay=observed.settings),
        EFFECTS_FILE: effects_document(name, effects),
        SENSOR_NOISE_FILE: noise.document(),
        DIAGNOSIS_FILE: {
            "flight": name,
            "start_us": start_us,
            "duration_s": logged.duration_s,
            "replayable": is_replayable,
            "readable": "topics" in metadata,
            "refused": _refusals(metadata["verdict"]),
            "diagnoses": [one.document(start_us) for one in found],
            "not_told": asked.failed,
        },
    }
    return documents, found, track


def _forget_what_flew(observed: ObservedFlight) -> None:
    """Drop what the health alone asks for, where there is a replay: of an hour a hundred megabytes."""
    if observed.verdict.status != REPLAYABLE or not observed.airborne:
        return
    for flight in (observed.logged, observed.flight):
        for name, instance in [*flight.topics]:
            if name.startswith(_OF_THE_FLOWN_FILTER):
                flight.topics.pop((name, instance), None)
    give_back_freed_memory()


_OF_THE_FLOWN_FILTER = ("estimator_aid_src_", "estimator_innovation")
"""Topics of its innovations, for which those of the replay stand."""


def _track(observed: ObservedFlight, is_replayable: bool) -> FlownTrack | None:
    """Where it was; smoothed where it can be replayed."""
    track = flown_track(observed.flight)
    return smoothed_track(observed, track) if track is not None and is_replayable else track


def _refusals(verdict: Mapping[str, Any]) -> list[dict[str, str]]:
    """Why a log is not replayed, each with what would mend it; of a replayable one there are none."""
    failed = of_severity(from_documents(verdict["findings"]), "fail")
    return [{"found": one.found, "remedy": one.remedy} for one in failed]


class _Asked:
    """Asks, and keeps what could not be answered for what a log that is no use for a replay lacks."""

    def __init__(self, is_replayable: bool) -> None:
        self._is_replayable = is_replayable
        self.failed: dict[str, str] = {}

    def about(self, what: str, nothing: Told, ask: Callable[[], Told]) -> Told:
        try:
            told = ask()
            give_back_freed_memory()
            return told
        except OF_DAMAGE as error:
            # a flight whose verdict is sound has all that is asked for: then it is a fault of the program
            if self._is_replayable:
                raise
            self.failed[what] = f"{type(error).__name__}: {error}"
            return nothing


def _write(folder: Path, documents: Mapping[str, Mapping[str, Any]]) -> None:
    for file, document in documents.items():
        with atomic_path(folder / file) as temporary:
            write_document(temporary, dict(document))
