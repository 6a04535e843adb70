"""Replay parameter sets on one flight: saved as Parquet, or straight from a log."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.reconstruction import (
    RECONSTRUCTION_TOPICS,
    ReconstructedFlight,
    ReconstructionSettings,
    as_logged,
    measured_rows,
    reconstruct,
)
from fusetune.analyze.replaying.replay_files import ReplayIdentity, finish_replay, replay_writer
from fusetune.analyze.replaying.replay_settings import ReplaySettings, StartSettings
from fusetune.analyze.replaying.set_input import read_set_files
from fusetune.analyze.replaying.start_choice import COLD, START_TOPICS, WARM, Start, choose_start
from fusetune.analyze.replaying.withheld_gaps import plan_gaps
from fusetune.ekf2.feed.inputs import EstimatorInputs, build_inputs
from fusetune.ekf2.filter.common.parameters import complete
from fusetune.ekf2.replay.recording import RecordArrays
from fusetune.ekf2.replay.replay import replay, replay_into
from fusetune.ekf2.replay.results import Gap, ReplayResult, ReplaySummary
from fusetune.errors import UserError
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.estimator_instances import of_one_instance
from fusetune.px4.layouts.logged_state import Handover, logged_handovers
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight
from fusetune.storage.files import AnyPath

Summary = TypeVar("Summary", bound=ReplaySummary)

REPLAY_TOPICS = (*dict.fromkeys((*RECONSTRUCTION_TOPICS, *START_TOPICS)),)
"""What a replay reads of a saved flight."""


@dataclass(frozen=True)
class PreparedFlight:
    """What the replays of all sets on one flight share: samples, start, and which samples were measured."""

    flight: Flight
    """As it was logged, in the layout of `fusetune.px4.layouts.release_layouts.canonical`."""
    inputs: EstimatorInputs
    reconstructed: ReconstructedFlight
    start: Start
    gaps: tuple[Gap, ...] = ()
    handovers: tuple[Handover, ...] = ()

    def replay(
        self,
        params: Mapping[str, float],
        overridden: frozenset[str] = frozenset(),
        keep: Callable[[RecordArrays], RecordArrays] | None = None,
    ) -> tuple[ReplayResult, np.ndarray]:
        """Replay a complete set; the result, and for each innovation whether its sample was measured.

        `keep` as for `fusetune.ekf2.replay.replay`.
        """
        result = replay(self.inputs, params, overridden=overridden, keep=keep, **self._shared())
        return self._with_measured_gaps(result, params), self.measured(result.innovations, params, result)

    def replay_into(
        self,
        take: Callable[[RecordArrays], None],
        params: Mapping[str, float],
        overridden: frozenset[str] = frozenset(),
    ) -> ReplaySummary:
        """Replay a complete set and hand on its rows as they come, see `fusetune.ekf2.replay.replay.replay_into`."""
        summary = replay_into(take, self.inputs, params, overridden=overridden, **self._shared())
        return self._with_measured_gaps(summary, params)

    def measured(self, innovations: np.ndarray, params: Mapping[str, float], of: ReplaySummary) -> np.ndarray:
        """For each innovation row of a replay whether its sample was measured."""
        return measured_rows(innovations, self.reconstructed, params, of.update_interval_us)

    def _shared(self) -> dict[str, Any]:
        return {"start": self.start.state, "gaps": self.gaps, "handovers": self.handovers}

    def _with_measured_gaps(self, summary: Summary, params: Mapping[str, float]) -> Summary:
        gaps = tuple(
            dataclasses.replace(gap, innovations=gap.innovations[self.measured(gap.innovations, params, summary)])
            for gap in summary.gaps
        )
        return dataclasses.replace(summary, gaps=gaps)

    def with_stream(self, reconstructed: ReconstructedFlight) -> PreparedFlight:
        """The same flight, started alike, with another sensor stream."""
        return dataclasses.replace(self, inputs=build_inputs(reconstructed.flight), reconstructed=reconstructed)

    def description(self, result: ReplaySummary) -> dict[str, Any]:
        """For the JSON file of a replay: how it started and what was reconstructed."""
        warm = result.warm_start_us is not None
        return {
            "start": {"mode": WARM if warm else COLD, "why": self.start.why, "time_us": result.warm_start_us},
            "reconstruction": [asdict(step) for step in self.reconstructed.steps],
            "handover_timestamps": [one.time_us for one in self.handovers],
        }


def prepare(
    flight: Flight,
    reconstruction: ReconstructionSettings | None = None,
    start: StartSettings | None = None,
    gaps: Sequence[Gap] = (),
) -> PreparedFlight:
    """Reconstruct the sensor stream of a canonical flight and choose how its replays start.

    `None` leaves the stream as it was logged, and starts cold.
    """
    chosen = Start(None, "asked for") if start is None else choose_start(flight, start)
    reconstructed = as_logged(flight) if reconstruction is None else reconstruct(flight, reconstruction, chosen.state)
    handovers = logged_handovers(flight)
    return PreparedFlight(flight, build_inputs(reconstructed.flight), reconstructed, chosen, tuple(gaps), handovers)


def replay_saved_flight(
    flight_folder: AnyPath,
    sets: Mapping[str, Mapping[str, float]],
    output_folder: AnyPath,
    settings: ReplaySettings | None = None,
) -> PreparedFlight:
    """Replay sets on a saved flight, `results/save/<flight>`; all else as in `replay_flight`."""
    return replay_flight(load_flight(flight_folder, topics=REPLAY_TOPICS), sets, output_folder, settings)


def replay_flight(
    flight: Flight,
    sets: Mapping[str, Mapping[str, float]],
    output_folder: AnyPath,
    settings: ReplaySettings | None = None,
) -> PreparedFlight:
    """Replay sets on a flight in memory.

    Parameters
    ----------
    flight : Flight
        With `REPLAY_TOPICS`.
    sets : mapping
        Name of each set → its overrides of the log's own parameters; may be empty.
    output_folder : Path
        Takes the files of `fusetune.analyze.replaying.replay_files` for each set.
    settings : ReplaySettings, optional
        By default the samples are used as they were logged, and the filter starts from nothing.

    Returns
    -------
    PreparedFlight
        For further replays.
    """
    output_folder = Path(output_folder)
    settings = settings or ReplaySettings()
    flight = canonical(flight)
    gaps = plan_gaps(flight, airborne_intervals(flight, {}), settings.withholding) if settings.withholding else ()
    prepared = prepare(flight, settings.reconstruction, settings.start, gaps)
    for name, overrides in sets.items():
        params = complete(flight.parameters.initial, overrides, flight.release)
        write_replay(prepared, name, overrides, params, output_folder)
    return prepared


def write_replay(
    prepared: PreparedFlight, name: str, overrides: Mapping[str, float], params: Mapping[str, float], folder: AnyPath
) -> None:
    """Replay a complete set and write its files while it goes on.

    Parameters
    ----------
    name, overrides : of the set; parameters that it varies
    params : all of its parameters
    folder : takes the files of `fusetune.analyze.replaying.replay_files`
    """
    told_apart = prepared.reconstructed.changed
    with replay_writer(folder, name, told_apart=told_apart) as writer:
        summary = prepared.replay_into(writer.take, params, frozenset(overrides))
        if told_apart:
            writer.write_spooled(lambda rows: prepared.measured(rows, params, summary))
    finish_replay(folder, ReplayIdentity(name, overrides, params, prepared.description(summary)), summary)


def replay_log(
    log: AnyPath,
    sets_folder: AnyPath,
    output_folder: AnyPath,
    settings: ReplaySettings | None = None,
) -> list[str]:
    """Replay every set that a folder holds as `SET.json` on one ULog file.

    `params` of each JSON file are the EKF2 parameters used, `overrides` those that differ from the log.

    Parameters
    ----------
    settings : ReplaySettings, optional
        By default the samples are used as they were logged, and the filter starts from nothing. No gaps are made.

    Returns
    -------
    list of str
        Names of the sets replayed.

    Raises
    ------
    UserError
        The log cannot be read, or a set file is not usable.
    """
    from fusetune.px4.ulog.reader import read_ulog

    sets = read_set_files(sets_folder)
    Path(output_folder).mkdir(parents=True, exist_ok=True)
    settings = settings or ReplaySettings()
    flight = read_ulog(log)
    # as PX4's own replay does where nothing is asked for: one estimator instance, from its sensors
    flown = flight if settings.reconstruction is not None else of_one_instance(flight)
    try:
        prepared = prepare(canonical(flown), settings.reconstruction, settings.start)
    except (LookupError, ValueError, TypeError, ArithmeticError) as error:
        # damage, or the logger, can take any topic and any field away
        reason = f"cannot be replayed ({type(error).__name__}: {error})"
        raise UserError(log, reason, "See what the command `fusetune save` says of it") from error
    for name, (params, overrides) in sets.items():
        values = complete(flight.parameters.initial, params | overrides, flight.release)
        write_replay(prepared, name, overrides, values, Path(output_folder))
    return list(sets)
