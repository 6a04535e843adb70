"""Scores all parameter sets of one flight on the same samples and writes the figures."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from fusetune.analyze.flight.intervals import Cut, Interval, subtract
from fusetune.analyze.flight.phases import IMU_TOPICS, airborne_intervals, imu_gaps
from fusetune.analyze.flight.reference_truth import TRUTH_TOPICS, Truth, read_references
from fusetune.analyze.replaying.filter_states import read_states
from fusetune.analyze.replaying.row_groups import tables_in_groups
from fusetune.analyze.replaying.sample_spool import SampleSpool
from fusetune.analyze.replaying.set_files import AxisSamples, SetRecord, SourceAxis, read_innovations, read_set
from fusetune.analyze.scoring.activity import inactive_parameters, same_results
from fusetune.analyze.scoring.block_scores import BLOCK_SCHEMA, block_rows
from fusetune.analyze.scoring.filter_events import FilterEvents, filter_events
from fusetune.analyze.scoring.ground_metrics import add_ground_events, add_ground_metrics, ground_window
from fusetune.analyze.scoring.measurement_alignment import PairedSamples, SamplesOfSet, paired_samples
from fusetune.analyze.scoring.metrics_table import (
    FEWEST_SAMPLES,
    MetricsTable,
    add_axis_metrics,
    add_events,
    add_group_metrics,
    add_true_errors,
    add_whiteness,
    groups_of,
)
from fusetune.analyze.scoring.onboard import ONBOARD, onboard_samples, write_onboard
from fusetune.analyze.scoring.scoring_settings import ScoringSettings
from fusetune.analyze.scoring.scoring_window import ScoringWindow, scoring_window
from fusetune.analyze.scoring.true_errors import true_errors
from fusetune.analyze.scoring.window_scores import (
    WINDOW_SCHEMA,
    add_worst_windows,
    window_edges,
    window_figures,
    window_rows,
)
from fusetune.analyze.scoring.withheld_scores import (
    WITHHELD_SCHEMA,
    add_true_drift,
    add_withheld_metrics,
    paired_gaps,
    withheld_rows,
)
from fusetune.analyze.sensors.source_whiteness import Whiteness, source_whiteness
from fusetune.finding import documents
from fusetune.px4.aid_sources import AXES, MEASURED_SOURCES
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import write_table

SAMPLES_SCHEMA = pa.schema(
    [
        pa.field("set", pa.dictionary(pa.int32(), pa.string())),
        pa.field("source", pa.dictionary(pa.int32(), pa.string())),
        pa.field("axis", pa.int8()),
        pa.field("time_us", pa.int64()),
        pa.field("innovation", pa.float32()),
        pa.field("innovation_variance", pa.float32()),
        pa.field("test_ratio", pa.float32()),
    ]
)

_AID_SOURCE_TOPICS = tuple(source.topic for source in MEASURED_SOURCES.values())
_LARGE_TOPICS = (*IMU_TOPICS, *_AID_SOURCE_TOPICS)

SCORE_TOPICS = (
    "vehicle_land_detected",
    "sensor_combined",
    "vehicle_imu",
    *TRUTH_TOPICS,
    "estimator_selector_status",
    "estimator_innovations",
    "estimator_innovation_variances",
    "estimator_innovation_test_ratios",
    "ekf2_innovations",
    "estimator_status",
    *_AID_SOURCE_TOPICS,
)
"""What the metrics need of a saved flight."""


def score_saved_flight(
    flight_folder: AnyPath,
    analyze_folder: AnyPath,
    sets: Sequence[str],
    *,
    present: str = "present",
    settings: ScoringSettings | None = None,
) -> None:
    """Score the sets on a saved flight, `results/save/<flight>`; all else as in `score_flight`."""
    flight_folder, analyze_folder = Path(flight_folder), Path(analyze_folder)
    flight = load_flight(flight_folder, topics=SCORE_TOPICS)
    score_flight(flight, analyze_folder, sets, present=present, settings=settings)


def score_flight(
    flight: Flight,
    analyze_folder: AnyPath,
    sets: Sequence[str],
    *,
    present: str = "present",
    settings: ScoringSettings | None = None,
) -> None:
    """Score every parameter set of one flight and write `metrics.parquet`, `scores.parquet`, `samples.parquet`,
    `windows.parquet`, `withheld.parquet`, `scoring.json` and `onboard.innovations.parquet` to `analyze_folder`.

    Parameters
    ----------
    flight : with `SCORE_TOPICS`, as it was logged
    analyze_folder : holds the replays of all sets, `results/analyze/<flight>`
    sets : names of the sets, the present one among them or added
    present : the set that flies now; the others are compared with it

    Raises
    ------
    UserError
        If a file of a replay is missing or damaged. A flight that cannot be scored is no error: its files say why.
    """
    settings, folder = settings or ScoringSettings(), Path(analyze_folder)
    flight = canonical(flight)
    log_gaps = imu_gaps(flight, settings.log_gap_s)
    onboard_file, spool = folder / f"{ONBOARD}.innovations.parquet", SampleSpool(folder)
    write_onboard(onboard_file, onboard_samples(flight))
    onboard = read_innovations(onboard_file, {}, spool)
    # nothing below asks the flight for the IMU or for innovations, and nothing of it is larger
    flight = flight.with_topics({key: table for key, table in flight.topics.items() if key[0] not in _LARGE_TOPICS})
    records = [read_set(folder, name, spool) for name in dict.fromkeys((present, *sets))]
    airborne = airborne_intervals(flight, records[0].flags)
    window = scoring_window(records, present, airborne, log_gaps, settings)
    phase = _flight_after_warm_up(airborne, window)
    events = {record.name: filter_events(record, phase) for record in records}

    table = MetricsTable(flight.name)
    flight_s = sum(stop - start for start, stop in phase) * 1e-6
    for name, event in events.items():
        add_events(table, name, event, flight_s)
    log = flight.start_timestamp, flight.last_timestamp
    ground = ground_window(records, present, airborne, log, log_gaps, window, settings)
    add_ground_metrics(table, records, present, ground, settings.confidence)
    for record in records:
        add_ground_events(table, record.name, filter_events(record, ground.intervals), ground)
    blocks: list[pa.Table] = []
    windows: list[pa.Table] = []
    whiteness: dict[tuple[str, int], Whiteness] = {}
    withheld = WITHHELD_SCHEMA.empty_table()
    scored = [record for record in records if record.name not in window.excluded] if window.intervals else []
    with tables_in_groups(folder / "samples.parquet", SAMPLES_SCHEMA) as write_samples:
        if scored:
            blocks, windows = _score_samples(table, scored, present, window, settings, folder, write_samples)
    if scored:
        # Replays from elsewhere, such as PX4's own estimator, come without gaps.
        has_gaps = all((folder / f"{record.name}.withheld.parquet").exists() for record in scored)
        gaps = paired_gaps(scored, folder, present, window) if has_gaps else []
        add_withheld_metrics(table, gaps)
        withheld = withheld_rows(flight.name, gaps, window.block_edges(settings.block_s))
        _add_onboard(table, onboard, window, settings, records[0].parameters)
        references = read_references(flight, _fused_sources(records), records[0].parameters)
        whiteness = _add_state_figures(table, scored, folder, flight, references, window, settings)
        for truth in references:
            if truth.kind == "truth" and has_gaps:
                add_true_drift(table, scored, folder, truth, window)
    summary = _summary(flight, records, present, window, events, settings)
    summary["white_share"] = {
        f"{source}.{AXES[axis]}": round(one.white_share, 4)
        for (source, axis), one in whiteness.items()
        if np.isfinite(one.white_share)
    }
    _write(folder, table, blocks, windows, withheld, summary)


def _flight_after_warm_up(airborne: Sequence[Interval], window: ScoringWindow) -> tuple[Interval, ...]:
    if window.warm_up_end is None:
        return tuple(airborne)
    return subtract(airborne, [Cut(-(2**62), window.warm_up_end, "warm-up")])


def _fused_sources(records: Sequence[SetRecord]) -> set[str]:
    return {source for record in records for source in record.fused_sources}


def _add_state_figures(
    table: MetricsTable,
    records: list[SetRecord],
    folder: Path,
    flight: Flight,
    references: Sequence[Truth],
    window: ScoringWindow,
    settings: ScoringSettings,
) -> dict[tuple[str, int], Whiteness]:
    """Append what takes the states of each replay: whiteness of the sources, errors against the references.

    Returns
    -------
    The whiteness as the first of the records, the present set, sees it
    """
    present: dict[tuple[str, int], Whiteness] = {}
    for number, record in enumerate(records):
        states = read_states(folder, record.name)
        found = source_whiteness(record, states, flight, window)
        add_whiteness(table, record.name, found)
        present = present if number else found
        for truth in references:
            figures = true_errors(record, states, truth, window, settings.confidence)
            add_true_errors(table, record.name, figures, truth.kind)
    return present


def _score_samples(
    table: MetricsTable,
    records: list[SetRecord],
    present: str,
    window: ScoringWindow,
    settings: ScoringSettings,
    folder: Path,
    write_samples: Callable[[pa.Table], None],
) -> tuple[list[pa.Table], list[pa.Table]]:
    edges, wide_edges = window.block_edges(settings.block_s), window_edges(window, settings.window_s)
    blocks, windows = [], []
    for source in MEASURED_SOURCES.values():
        pairs: dict[int, PairedSamples] = {}
        spool = SampleSpool(folder)
        for axis in range(source.axes):
            found = paired_samples(records, (source.name, axis), present, window, spool)
            if found is not None:
                pairs[axis] = found
        for one in pairs.values():
            add_axis_metrics(table, one, settings)
            blocks.append(block_rows(table.flight, one, edges))
            # of what is sampled at every update the samples would fill the disk, and no plot shows them
            if not source.every_update:
                for of_set in one.each():
                    write_samples(_sample_rows(of_set))
        if pairs:
            add_group_metrics(table, pairs, settings)
        single = [(AXES[axis], [one]) for axis, one in pairs.items() if one.time.size >= FEWEST_SAMPLES]
        for axis_name, members in (*single, *groups_of(pairs)):
            figures = window_figures(members, axis_name, wide_edges)
            add_worst_windows(table, figures)
            windows.append(window_rows(table.flight, figures, wide_edges))
    return blocks, windows


def _sample_rows(pairs: SamplesOfSet) -> pa.Table:
    """Rows of `samples.parquet` of one set."""
    n = pairs.time.size

    def repeated(name: str) -> pa.Array:
        return pa.DictionaryArray.from_arrays(pa.array(np.zeros(n, np.int32)), pa.array([name], pa.string()))

    columns = {
        "set": repeated(pairs.sets[0]),
        "source": repeated(pairs.source),
        "axis": pa.array(np.full(n, pairs.axis, dtype=np.int8)),
        "time_us": pa.array(pairs.time),
    }
    for name in ("innovation", "innovation_variance", "test_ratio"):
        columns[name] = pa.array(getattr(pairs, name)[0].astype(np.float32))
    return pa.table(columns, schema=SAMPLES_SCHEMA)


def _add_onboard(
    table: MetricsTable,
    onboard: Mapping[SourceAxis, AxisSamples],
    window: ScoringWindow,
    settings: ScoringSettings,
    parameters: dict[str, float],
) -> None:
    """Append the vehicle's own figures, on the same part of the flight but at the times that it logged."""
    record = SetRecord(ONBOARD, parameters, {}, {}, onboard, {}, {})
    for source in MEASURED_SOURCES.values():
        pairs = {}
        for axis in range(source.axes):
            found = paired_samples([record], (source.name, axis), ONBOARD, window)
            if found is not None:
                pairs[axis] = found
                add_axis_metrics(table, found, settings)
        if pairs:
            add_group_metrics(table, pairs, settings)


def _summary(
    flight: Flight,
    records: list[SetRecord],
    present: str,
    window: ScoringWindow,
    events: dict[str, FilterEvents],
    settings: ScoringSettings,
) -> dict[str, Any]:
    by_name = {record.name: record for record in records}
    return {
        "flight": flight.name,
        "status": "scored" if window.intervals else "not_scored",
        "reason": window.reason,
        "checksum": flight.checksum,
        "firmware": flight.release_name,
        "present": present,
        "scored_s": round(window.duration_s, 3),
        "warm_up_end_us": window.warm_up_end,
        "intervals_us": [list(interval) for interval in window.intervals],
        "block_edges_us": window.block_edges(settings.block_s).tolist() if window.intervals else [],
        "cuts": documents(cut.finding for cut in window.cuts),
        "sets": {
            name: _set_summary(record, by_name[present], window, events[name], flight)
            for name, record in by_name.items()
        },
    }


def _set_summary(
    record: SetRecord, present: SetRecord, window: ScoringWindow, events: FilterEvents, flight: Flight
) -> dict[str, Any]:
    excluded = window.excluded.get(record.name, "")
    ok = record.status == "ok"
    outcome = "excluded" if excluded else "scored" if window.intervals else "not_scored"
    return {
        "status": outcome if ok else record.status,
        "reason": excluded,
        "overrides": record.overrides,
        "parameters": record.parameters,
        "resets": events.resets,
        "timeouts": {name: count for name, count in events.timeouts.items() if count},
        "faults": list(events.faults),
        "fault_flags": events.fault_flags,
        "dead_reckoning_s": round(events.dead_reckoning_s, 3),
        "same_results_as_present": record is not present and ok and same_results(record, present),
        "inactive": inactive_parameters(record, present, flight) if ok and record is not present else {},
    }


def _write(
    folder: Path,
    table: MetricsTable,
    blocks: list[pa.Table],
    windows: list[pa.Table],
    withheld: pa.Table,
    summary: dict[str, Any],
) -> None:
    tables = {
        "metrics.parquet": table.finished(),
        "scores.parquet": pa.concat_tables(blocks) if blocks else BLOCK_SCHEMA.empty_table(),
        "windows.parquet": pa.concat_tables(windows) if windows else WINDOW_SCHEMA.empty_table(),
        "withheld.parquet": withheld,
    }
    for name, content in tables.items():
        with atomic_path(folder / name) as temporary:
            write_table(content, temporary)
    with atomic_path(folder / "scoring.json") as temporary:
        write_document(temporary, summary, sort_keys=True)
