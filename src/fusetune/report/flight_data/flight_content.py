"""Puts together what is shown of a flight, from what the rooms wrote of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from fusetune.analyze.conformance.track_file import read_track
from fusetune.analyze.flight_files import (
    CONFORMANCE_FILE,
    ONBOARD_FILE,
    SAMPLES_FILE,
    SCORE_TABLES,
    SCORING_FILE,
    TRACK_FILE,
)
from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.report.flight_data.bands import bands
from fusetune.report.flight_data.content import FlightContent, Panel
from fusetune.report.flight_data.events import events
from fusetune.report.flight_data.innovation_panels import (
    AxisInnovations,
    Innovations,
    SetInnovations,
    innovation_panels,
    ratio_panels,
    recorded_innovations,
    scored_innovations,
)
from fusetune.report.flight_data.logged import Logged, read_logged
from fusetune.report.flight_data.marks import marks
from fusetune.report.flight_data.position_frame import PositionFrame, position_frame
from fusetune.report.flight_data.preparing import prepared
from fusetune.report.flight_data.replays import Replay, replays_of
from fusetune.report.flight_data.sensor_panels import (
    output_tracking_panels,
    reset_panel,
    sensor_panels,
    status_ratio_panel,
    vibration_panels,
)
from fusetune.report.flight_data.shown_sets import UNDECIDED, Choice, replayed_sets, shown_sets
from fusetune.report.flight_data.state_panels import (
    Teller,
    earth_field,
    inner_state_panels,
    inner_states,
    motion_panels,
    tellers,
)
from fusetune.report.flight_data.track_view import track_view
from fusetune.report.flight_names import short_names
from fusetune.report.flight_results import read_flight_results
from fusetune.set_names import AS_FLOWN, ONBOARD, PRESENT
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

LABELS = {ONBOARD: "the vehicle's own filter", AS_FLOWN: "replay as flown"}
"""Of what no study names."""


def flight_content(
    flight_folder: AnyPath, analyze_folder: AnyPath, sets: Sequence[str] = (), choice: Choice = UNDECIDED
) -> FlightContent:
    """Gather it.

    Parameters
    ----------
    flight_folder : `results/save/<flight>` of a log of which something could be read
    analyze_folder : `results/analyze/<flight>`; of a flight that is not replayed without replays and scores
    sets : that are told first behind the present one and the chosen one, in this order
    choice : what was decided, where it is known

    Raises
    ------
    UserError
        A file is missing or damaged.
    """
    folder = Path(analyze_folder)
    results = read_flight_results(folder)
    scoring = _document(folder / SCORING_FILE)
    logged = read_logged(flight_folder, innovations=not (folder / ONBOARD_FILE).exists())
    replays = replays_of(folder, scoring)
    present = PRESENT if scoring is None else scoring["present"]
    first = [*([choice.chosen] if choice.chosen else []), *sets]
    shown = replayed_sets(scoring, folder / SCORE_TABLES["blocks"], first)
    innovations = list(_innovations(folder, logged, scoring, replays, shown))
    flags, position = (replays[0].status_flags, replays[0].local_position) if replays else (None, None)
    frame = position_frame(replays[0].summary if replays else None, logged.topic("vehicle_local_position"))
    told = tellers(logged, replays, LABELS, frame)
    start_us = logged.flight.start_timestamp
    panels = tuple(
        prepared(one, start_us) for one in flight_panels(logged, replays, innovations, told, frame, results.health)
    )
    curves = (one.set for panel in panels for one in panel.series if one.set is not None)
    names = [*dict.fromkeys([*(one.name for one in innovations), *curves])]
    flight = logged.flight
    return FlightContent(
        flight=results.flight,
        label=flight_label(results.flight, results.date),
        start_us=start_us,
        duration_s=flight.duration_s,
        takeoff_s=_finite(results.times.take_off_s),
        landing_s=_finite(results.times.landing_s),
        sets=shown_sets(names, scoring, present, choice),
        panels=panels,
        bands=tuple(bands(logged, flags, scoring)),
        marks=tuple(marks(results)),
        events=tuple(events(logged, position, flags)),
        track=track_view(_track(folder), _document(folder / CONFORMANCE_FILE), flight, told, frame),
    )


def flight_panels(
    logged: Logged,
    replays: Sequence[Replay],
    innovations: Sequence[SetInnovations],
    told: Sequence[Teller],
    frame: PositionFrame,
    health: Sequence[Mapping[str, Any]],
) -> Iterator[Panel]:
    """In the order of `panel_names.GROUPS`."""
    yield from innovation_panels(innovations)
    yield from ratio_panels(innovations)
    yield from status_ratio_panel(logged)
    gnss, parameters = logged.topic("vehicle_gps_position"), replays[0].parameters if replays else logged.parameters
    yield from motion_panels(told, gnss, round(parameters["EKF2_GPS_DELAY"] * 1e3), frame)
    inner = inner_states(logged, replays, LABELS)
    yield from inner_state_panels(inner)
    yield from output_tracking_panels(logged)
    yield from vibration_panels(logged, health)
    yield from sensor_panels(logged, health, earth_field(inner))
    yield from reset_panel(logged)


def _innovations(
    folder: Path, logged: Logged, scoring: Mapping[str, Any] | None, replays: Sequence[Replay], sets: Sequence[str]
) -> Iterator[SetInnovations]:
    """The present set, what flew, the vehicle's own, and of the other sets what was scored."""
    for one in replays:
        yield SetInnovations(one.name, LABELS.get(one.name, one.name), one.innovations, one.parameters)
    own = _own_innovations(folder, logged)
    if own:
        yield SetInnovations(ONBOARD, LABELS[ONBOARD], own, logged.parameters)
    others = [name for name in sets if name not in {one.name for one in replays}]
    if scoring is not None and others:
        scored = scored_innovations(folder / SAMPLES_FILE, others)
        for name in others:
            if scored[name]:
                yield SetInnovations(name, name, scored[name], scoring["sets"][name]["parameters"])


def _own_innovations(folder: Path, logged: Logged) -> Innovations:
    """Of the vehicle's filter: as the analysis wrote them, or of the log where there is none."""
    file = folder / ONBOARD_FILE
    if file.exists():
        return recorded_innovations(file)
    return logged_innovations(logged)


def logged_innovations(logged: Logged) -> Innovations:
    """Of the vehicle's own filter, as its log holds them."""
    samples = onboard_samples(logged.flight)
    return {
        key: AxisInnovations(
            one.timestamp_sample, one.innovation, one.innovation_variance, one.test_ratio, one.rejected, one.fused
        ).since_fused()
        for key in samples
        if (one := samples[key]).timestamp_sample.size
    }


def _track(folder: Path) -> Any:
    file = folder / TRACK_FILE
    return read_track(file) if file.exists() else None


def _document(file: Path) -> dict[str, Any] | None:
    return read_document(file) if file.exists() else None


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def flight_label(flight: str, date: str) -> str:
    """A flight in few words: when it was, and what its log is called without what says that again.

    Parameters
    ----------
    date : ISO 8601; empty where the log does not tell
    """
    (name,) = short_names([flight]).values()
    try:
        when = datetime.fromisoformat(date)
    except ValueError:
        return name
    return f"{when.day} {when:%b %Y %H:%M} · {name}"
