"""Replay parameter sets on a prepared flight: into memory, or into the store."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, PreparedFlight, prepare_flight
from fusetune.analyze.replaying.replay_summary import ReplayIdentity, summary_document
from fusetune.analyze.replaying.replayed_set import (
    STATE_BLOCKS,
    STEP_BLOCKS,
    Columns,
    ReplayedSet,
    joined_states,
    joined_steps,
    values_of,
)
from fusetune.analyze.replaying.samples import AxisSamples, SortedSamples, SourceAxis, gate_of
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.replaying.store.columns import flag_columns, gap_columns, prediction_columns
from fusetune.analyze.replaying.store.parts import TABLES, summary_file, table_file
from fusetune.analyze.replaying.store.writer import finish_replay, replay_writer
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.recording import (
    FLAGS_ROW,
    FULL,
    INNOVATION_ROW,
    LOCAL_POSITION_ROW,
    RecordArrays,
    Recording,
    joined_rows,
)
from fusetune.ekf2.replay.results import ReplaySummary
from fusetune.save.flight_folder import load_flight
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path

_LOCAL_POSITION = tuple(name for name in LOCAL_POSITION_ROW.names or () if name != "q")
"""What is kept in memory of the published position."""


def replay_set(
    prepared: PreparedFlight, name: str, overrides: Mapping[str, float], recording: Recording = FULL
) -> ReplayedSet:
    """Replay one set and keep in memory what scores are made of; no file is written.

    Parameters
    ----------
    name, overrides : of the set; parameters in which it differs from the log's own
    recording : all but `FULL` leave out the states' IMU steps; `SCORING` the published position but around resets, too
    """
    params = prepared.parameters(overrides)
    kept = _Kept(recording)
    summary = prepared.replay_into(kept.take, params, frozenset(overrides), recording)
    document = summary_document(
        ReplayIdentity(name, overrides, params, prepared.release, prepared.description(summary)), summary
    )
    parameters = values_of(document, "params")
    changed = prepared.reconstructed.changed
    measured = partial(prepared.measured, params=params, of=summary) if changed else None
    return ReplayedSet(
        name=name,
        parameters=parameters,
        overrides=values_of(document, "overrides"),
        summary=document,
        samples=kept.samples(parameters, measured),
        flags=flag_columns(joined_rows(kept.flags, FLAGS_ROW)),
        local_position=kept.positions(),
        states=partial(joined_states, kept.states),
        steps=partial(joined_steps, kept.states) if recording is FULL else None,
        withheld=partial(prediction_columns, summary.gaps),
        gaps=partial(gap_columns, summary.gaps),
    )


class _Kept:
    """Takes the rows of a replay and keeps what scores are made of."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.innovations: list[np.ndarray] = []
        self.states: list[Columns] = []
        self.local_position: list[Columns] = []
        self.flags: list[np.ndarray] = []

    def take(self, rows: RecordArrays) -> None:
        self.innovations.append(rows.innovations)
        if self._recording is FULL:
            states = {name: block.of_rows(rows.states) for name, block in (STATE_BLOCKS | STEP_BLOCKS).items()}
        else:
            states = {name: rows.states[name] for name in STATE_BLOCKS}
        self.states.append({"time": rows.states["timestamp_sample"].copy(), **states})
        self.local_position.append({name: np.array(rows.local_position[name]) for name in _LOCAL_POSITION})
        self.flags.append(rows.flags)

    def positions(self) -> Columns:
        """The published position."""
        nothing = {name: np.zeros(0, LOCAL_POSITION_ROW[name]) for name in _LOCAL_POSITION}
        pieces = [nothing, *self.local_position]
        return {name: np.concatenate([one[name] for one in pieces]) for name in _LOCAL_POSITION}

    def samples(
        self, parameters: Mapping[str, float], measured: Callable[[np.ndarray], np.ndarray] | None
    ) -> Mapping[SourceAxis, AxisSamples]:
        """The innovations by source and axis; `measured` tells which rows are of samples that stand in the log."""
        rows = joined_rows(self.innovations, INNOVATION_ROW)
        self.innovations.clear()
        if measured is not None:
            rows = rows[measured(rows)]
        return SortedSamples(rows, AID_SOURCE_NAMES, partial(gate_of, parameters))


def replay_saved_flight(
    flight_folder: AnyPath,
    sets: Mapping[str, Mapping[str, float]],
    output_folder: AnyPath,
    settings: ReplaySettings | None = None,
) -> None:
    """Replay sets on a saved flight and write their files.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    sets : name of each set → its overrides of the log's own parameters; may be empty
    output_folder : takes the files of `fusetune.analyze.replaying.store` for each set
    settings : by default the samples are used as they were logged, and the filter starts from nothing
    """
    prepared = prepare_flight(load_flight(flight_folder, topics=REPLAY_TOPICS), settings or ReplaySettings())
    for name, overrides in sets.items():
        write_replay(prepared, name, overrides, output_folder)


def write_replay(
    prepared: PreparedFlight,
    name: str,
    overrides: Mapping[str, float],
    folder: AnyPath,
    *,
    params: Mapping[str, float] | None = None,
    also: Callable[[RecordArrays], None] | None = None,
) -> ReplaySummary:
    """Replay one set and write its files while it goes on.

    Parameters
    ----------
    name, overrides : of the set; parameters in which it differs from the log's own
    folder : takes the files of `fusetune.analyze.replaying.store`
    params : all of its parameters; by default what follows from the overrides
    also : is given the rows, too, as they come
    """
    values = prepared.parameters(overrides) if params is None else params
    told_apart = prepared.reconstructed.changed
    with replay_writer(folder, name, told_apart=told_apart) as writer:

        def take(rows: RecordArrays) -> None:
            writer.take(rows)
            if also is not None:
                also(rows)

        summary = prepared.replay_into(take, values, frozenset(overrides))
        if told_apart:
            writer.write_spooled(lambda rows: prepared.measured(rows, values, summary))
    finish_replay(
        folder, ReplayIdentity(name, overrides, values, prepared.release, prepared.description(summary)), summary
    )
    return summary


def copy_replay(
    prepared: PreparedFlight, folder: AnyPath, source: str, name: str, overrides: Mapping[str, float]
) -> None:
    """Write the files of a set whose replay is that of another one (`PreparedFlight.course_of`), which has its files.

    Raises
    ------
    UserError
        If a file of the other set is missing or damaged.
    """
    for table in TABLES:
        with atomic_path(table_file(folder, name, table)) as path:
            shutil.copyfile(table_file(folder, source, table), path)
    document = read_document(summary_file(folder, source), sealed=False)
    params = prepared.parameters(overrides)
    document |= {"set": name, "overrides": dict(overrides), "params": params}
    with atomic_path(summary_file(folder, name)) as path:
        write_document(path, document)
