"""A log that is replayed to be drawn, with its own parameters and with others, beside the pipeline."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from fusetune.analyze.conformance.flown_track import flown_track
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.replaying.replay_flight import write_replay
from fusetune.analyze.replaying.settings import WITHOUT_GAPS
from fusetune.analyze.sensor_noise.sensor_noise import sensor_noise
from fusetune.design.parameter_check import checked_values
from fusetune.px4.ulog.reader import read_ulog
from fusetune.report.figures.plotted_flight import PlottedFlight
from fusetune.report.flight_data.bands import bands
from fusetune.report.flight_data.flight_content import LABELS, flight_panels, logged_innovations
from fusetune.report.flight_data.innovation_panels import SetInnovations
from fusetune.report.flight_data.logged import Logged
from fusetune.report.flight_data.position_frame import position_frame
from fusetune.report.flight_data.replays import Replay
from fusetune.report.flight_data.shown_sets import Choice, shown_sets
from fusetune.report.flight_data.state_panels import tellers
from fusetune.report.flight_data.track_view import track_view
from fusetune.set_names import AS_FLOWN, ONBOARD
from fusetune.storage.files import AnyPath

ASKED = "asked"
"""The set whose values the command line gives."""
_ASKED_WORDS = 40


def flight_of_log(log: AnyPath, overrides: Mapping[str, float]) -> PlottedFlight:
    """Of a log: as it was flown, replayed with its own parameters, and with others where any are asked for.

    Parameters
    ----------
    overrides : parameters that differ from the log's own, by PX4's names

    Raises
    ------
    UserError
        The log cannot be read; parameters are asked for that PX4 does not have, or for a flight that cannot be
        replayed.
    """
    asked = checked_values(overrides, "--set")
    observed = ObservedFlight(read_ulog(log), WITHOUT_GAPS)
    logged = Logged(observed.logged, observed.flight)
    failures = observed.verdict.failures
    if asked:
        observed.verdict.demand_replayable(log)
    label = ", ".join(f"{name} {value:g}" for name, value in asked.items())
    labels = LABELS | {ASKED: label if len(label) <= _ASKED_WORDS else f"{len(asked)} parameters as asked"}
    with tempfile.TemporaryDirectory(prefix="fusetune-plot-") as folder:
        replays = [] if failures else [Replay(Path(folder), AS_FLOWN)]
        replays += [Replay(Path(folder), ASKED)] if asked else []
        for one in replays:
            write_replay(observed.prepared, one.name, asked if one.name == ASKED else {}, folder)
        return _told(Path(log).stem, observed, logged, replays, labels)


def _told(
    name: str, observed: ObservedFlight, logged: Logged, replays: Sequence[Replay], labels: Mapping[str, str]
) -> PlottedFlight:
    innovations = [SetInnovations(one.name, labels[one.name], one.innovations, one.parameters) for one in replays]
    own = logged_innovations(logged)
    if own:
        innovations.append(SetInnovations(ONBOARD, labels[ONBOARD], own, observed.parameters))
    frame = position_frame(replays[0].summary if replays else None, logged.topic("vehicle_local_position"))
    told = tellers(logged, replays, labels, frame)
    flight = observed.flight
    return PlottedFlight(
        name=name,
        start_us=flight.start_timestamp,
        duration_s=flight.duration_s,
        sets=shown_sets([*(one.name for one in replays), ONBOARD], None, AS_FLOWN, Choice(chosen=ASKED)),
        panels=tuple(flight_panels(logged, replays, innovations, told, frame, ())),
        bands=tuple(bands(logged, replays[0].status_flags if replays else None, None)),
        track=track_view(flown_track(observed.logged), None, flight, told, frame),
        characterise=lambda: sensor_noise(flight, observed.airborne),
        labels=labels,
        why_not_replayed="; ".join(observed.verdict.reasons),
    )
