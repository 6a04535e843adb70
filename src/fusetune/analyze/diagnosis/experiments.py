"""The replay as an experiment: the flight once more with a claimed cause taken away.

A wrong value is put right, a sensor that misleads is withheld where it does, a part that shakes is told to. If the
cause is what it is said to be, the test ratios of the sources that it spoils fall; if they stay or grow, the claim was
wrong. The sources that are compared are those that both replays have, over the same time.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fusetune.analyze.diagnosis.causes.magnetometer_rotated import claimed_mounting
from fusetune.analyze.diagnosis.causes.motor_magnetic_field import in_step
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Trial
from fusetune.analyze.diagnosis.innovation_signs import SourceRatios, replayed_ratios
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.ekf2.replay.recording import SCORING
from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.flight import Flight, TopicTable, row_count, select_rows

AT_MOST = 2
"""By default: with them a minute of flight is diagnosed in half a second."""
FALLS, GROWS = 0.9, 1.25
"""Mean test ratios are alike between these: what a replay changes by chance."""
FALLS_BY, GROWS_BY = 0.002, 0.005
"""Smaller differences of mean ratios say nothing: quotients of tiny numbers are no evidence."""
SAME = 1e-3
"""A replay whose ratios change by less did as the flight did."""
RIGHT_NOISE = 0.04
"""What a filter that claims the right noise shows behind a gate of 5 σ (1/25): a source within is not spoilt."""
SOUND = 0.5 * RIGHT_NOISE
"""Nothing is left to mend."""
SURER, NOT_BORNE_OUT, LESS_SURE = 0.5, 0.9, 0.6
"""A claim that the experiment bears out loses half of its doubt; one that it does not bear out, or contradicts, keeps
this of its confidence."""
LEAST_CONFIDENCE = 0.4
"""A claim below falls."""

Edit = Callable[[Flight], Flight]


@dataclass(frozen=True)
class Experiment:
    """What is done otherwise.

    Attributes
    ----------
    words : what is done, as `with EKF2_GPS_DELAY 90`
    judged : how the names of the sources begin whose ratios should fall
    overrides : parameters
    edit : of the flight, before it is replayed
    """

    words: str
    judged: tuple[str, ...]
    overrides: Mapping[str, float] = field(default_factory=dict)
    edit: Edit | None = None


def experiment_for(diagnosis: Diagnosis, signs: Signs) -> Experiment | None:
    """The experiment that a claim asks for; None where no replay can tell."""
    values = diagnosis.values
    if diagnosis.id in PARAMETERS_OF:
        judged, prefixes = PARAMETERS_OF[diagnosis.id]
        overrides = {name: value for name, value in values.items() if name.startswith(prefixes)}
        if not overrides:
            return None
        told = ", ".join(f"{name} {value:g}" for name, value in sorted(overrides.items()))
        return Experiment(f"with {told}", judged, overrides)
    if diagnosis.id in ("vibration", "accelerometer_clipping"):
        noise = max(0.8, 2.0 * signs.parameters.get("EKF2_ACC_NOISE", 0.35))
        return Experiment(
            f"with EKF2_ACC_NOISE {min(noise, 1.0):g}", ("gnss", "baro"), {"EKF2_ACC_NOISE": min(noise, 1.0)}
        )
    if diagnosis.id in WITHHELD or diagnosis.id == "sensor_stuck":
        stuck = max(STUCK, key=lambda name: values.get(f"{name}_stuck_s", 0.0))
        sensor, judged = WITHHELD.get(diagnosis.id, (stuck, STUCK[stuck]))
        words = (
            f"without {SENSORS[sensor].label} from {_at(signs, diagnosis.start_us)} to {_at(signs, diagnosis.stop_us)}"
        )
        return Experiment(
            words, judged, edit=lambda flight: _without(flight, sensor, diagnosis.start_us, diagnosis.stop_us)
        )
    motion, one = signs.motion, signs.magnetometer
    if diagnosis.id == "motor_magnetic_field" and motion is not None and one is not None:
        found = in_step(one)
        if found is None:
            return None
        coefficient = found
        return Experiment(
            "with the field of the motors taken out",
            ("mag",),
            edit=lambda flight: _magnetometer(
                flight, lambda time, field: field - motion.at(time, motion.thrust)[:, None] * coefficient
            ),
        )
    if diagnosis.id == "yaw_alignment":
        body = np.array([values[f"body_field_{axis}_gauss"] for axis in "xyz"])
        return Experiment(
            "with the field of the body taken out",
            ("mag",),
            edit=lambda flight: _magnetometer(flight, lambda _, field: field - body),
        )
    if diagnosis.id == "magnetometer_scale":
        scale = np.array([values[f"mag_scale_{axis}"] for axis in "xyz"])
        return Experiment(
            "with the magnetometer's scale put right",
            ("mag",),
            edit=lambda flight: _magnetometer(flight, lambda _, field: field / scale),
        )
    if diagnosis.id == "magnetometer_rotated":
        turn = claimed_mounting(signs)
        if turn is not None:
            return Experiment(
                "with the magnetometer turned back",
                ("mag", "gnss_vel"),
                edit=lambda flight: _magnetometer(flight, lambda _, field: field @ turn),
            )
    return None


PARAMETERS_OF: Mapping[str, tuple[tuple[str, ...], str]] = {
    "gnss_delay": (("gnss_vel", "gnss_pos"), "EKF2_GPS_DELAY"),
    "gnss_lever_arm": (("gnss_vel",), "EKF2_GPS_POS_"),
    "flow_delay": (("optical_flow",), "EKF2_OF_DELAY"),
    "vision_delay": (("ev",), "EKF2_EV_DELAY"),
    "baro_ground_effect": (("baro",), "EKF2_GND_EFF_DZ"),
}
"""Cause → sources that should do better with the values that it tells to set, and how the names of those begin. Noises
are not among them: a larger one makes each ratio smaller, right or wrong."""

WITHHELD: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "gnss_glitch": ("gnss", ("baro", "mag", "ev")),
    "gnss_accuracy": ("gnss", ("baro", "mag", "ev")),
    "gnss_interference": ("gnss", ("baro", "mag", "ev")),
    "magnetic_disturbance": ("mag", ("gnss_vel", "gnss_pos", "ev")),
    "propeller_wash": ("baro", ("gnss", "rng", "ev_hgt")),
    "baro_drift": ("baro", ("gnss", "rng", "ev_hgt")),
    "static_pressure": ("baro", ("gnss", "rng", "ev_hgt")),
    "range_obstruction": ("range", ("baro", "gnss_hgt", "optical_flow")),
    "range_step": ("range", ("baro", "gnss_hgt", "optical_flow")),
    "vision_yaw": ("ev", ("gnss", "mag")),
    "vision_scale": ("ev", ("gnss", "mag")),
    "vision_covariance": ("ev", ("gnss", "mag")),
    "flow_scale": ("flow", ("gnss",)),
    "flow_rotation": ("flow", ("gnss",)),
    "airspeed_scale": ("airspeed", ("gnss", "sideslip")),
}
"""Cause → the sensor that is withheld while it holds, and the sources that should do better without it."""

STUCK = {"mag": ("gnss_vel", "gnss_pos"), "baro": ("gnss_hgt", "rng"), "gnss": ("baro", "mag")}
"""Sensor that repeats one value → the sources that should do better without it."""


def _at(signs: Signs, time: int) -> str:
    return f"{signs.observed.since_start_s(time):.0f} s"


def _without(flight: Flight, sensor: str, start: int, stop: int) -> Flight:
    """The flight without the messages of a sensor in some time."""
    topics = dict(flight.topics)
    for topic in SENSORS[sensor].topics:
        for instance in flight.instances(topic.name):
            table = topics[topic.name, instance]
            time = table["timestamp"].astype(np.int64)
            topics[topic.name, instance] = select_rows(table, (time < start) | (time >= stop))
    return flight.with_topics(topics)


def _magnetometer(flight: Flight, change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Flight:
    """The flight with other readings of the magnetometer, (N, 3) of its times."""
    key = ("vehicle_magnetometer", 0)
    table: TopicTable = dict(flight.topics[key])
    names = [f"magnetometer_ga[{axis}]" for axis in range(3)]
    field = np.column_stack([table[name].astype(np.float64) for name in names])
    changed = change(table["timestamp"].astype(np.int64), field)
    table |= {name: changed[:, axis].astype(np.float32) for axis, name in enumerate(names)}
    return flight.with_topics(flight.topics | {key: table})


def tried(diagnosis: Diagnosis, signs: Signs) -> Diagnosis | None:
    """The diagnosis with what its experiment showed; None where it fell, as it was where there is no experiment."""
    experiment = experiment_for(diagnosis, signs)
    if experiment is None:
        return diagnosis
    before = signs.ratios
    after = replayed_ratios(_replayed(signs.observed.prepared, experiment), signs.airborne)
    compared = _compared(before, after, experiment.judged)
    if compared is None:
        return diagnosis
    shared = _shared(before, after, experiment.judged)
    grown = [name for name in shared if _is_spoilt(before[name].mean, after[name].mean)]
    trial = trial_of(experiment.words, _named(before, after, experiment.judged), *compared, grown)
    sure = diagnosis.confidence
    if trial.outcome == "better":
        sure = 1.0 - SURER * (1.0 - sure)
    elif trial.outcome != "tells nothing":
        sure *= LESS_SURE if trial.outcome == "worse" else NOT_BORNE_OUT
        if sure < LEAST_CONFIDENCE:
            return None
    return dataclasses.replace(diagnosis, trial=trial, confidence=round(sure, 3))


def trial_of(done: str, sources: str, before: float, after: float, grown: Sequence[str] = ()) -> Trial:
    """What a replay showed, in words.

    Parameters
    ----------
    done : what was done in it, as `without magnetometer from 4 s to 42 s`
    sources : that should do better, by name
    before, after : their mean test ratio
    grown : of these sources those that do worse by themselves: what mends one and spoils another bears nothing out
    """
    figures = f"mean test ratio of {sources} {before:.3g} before, {after:.3g} after"
    falls = before - after > FALLS_BY and after < FALLS * before
    if falls and grown:
        words = f"the replay {done} is better in the mean, but worse for {', '.join(grown)}: {figures}"
        return Trial(words, before, after, "no better")
    if falls:
        return Trial(f"the replay {done} is better: {figures}", before, after, "better")
    if _grows(before, after):
        return Trial(f"the replay {done} is worse: {figures}", before, after, "worse")
    if abs(after - before) <= SAME * before:
        words = f"the replay {done} is the same, so the filter made no use of it: {figures}"
        return Trial(words, before, after, "tells nothing")
    if before < SOUND:
        words = f"the replay {done} tells nothing, these sources are fine with it as well: {figures}"
        return Trial(words, before, after, "tells nothing")
    return Trial(f"the replay {done} is no better: {figures}", before, after, "no better")


def _is_spoilt(before: float, after: float) -> bool:
    return _grows(before, after) and after > RIGHT_NOISE


def _grows(before: float, after: float) -> bool:
    return after - before > GROWS_BY and after > GROWS * before


def _replayed(prepared: PreparedFlight, experiment: Experiment) -> ReplayedSet:
    if experiment.edit is not None:
        edited, logged = experiment.edit(prepared.reconstructed.flight), prepared.reconstructed.measured
        # of a topic with fewer rows it is no longer known which of them the log holds
        known = {name: rows for name, rows in logged.items() if rows.size == row_count(edited.topics[name, 0])}
        stream = dataclasses.replace(prepared.reconstructed, flight=edited, measured=known)
        prepared = prepared.with_stream(stream)
    # innovations alone are compared
    return replay_set(prepared, "experiment", experiment.overrides, SCORING)


def _shared(
    before: Mapping[str, SourceRatios], after: Mapping[str, SourceRatios], judged: tuple[str, ...]
) -> list[str]:
    return [name for name in before if name in after and name.startswith(judged)]


def _named(before: Mapping[str, SourceRatios], after: Mapping[str, SourceRatios], judged: tuple[str, ...]) -> str:
    return ", ".join(_shared(before, after, judged))


def _compared(
    before: Mapping[str, SourceRatios], after: Mapping[str, SourceRatios], judged: tuple[str, ...]
) -> tuple[float, float] | None:
    """Means of the mean ratios of the judged sources, each weighing alike."""
    shared = _shared(before, after, judged)
    if not shared:
        return None
    return float(np.mean([before[name].mean for name in shared])), float(np.mean([after[name].mean for name in shared]))


def with_experiments(found: Sequence[Diagnosis], signs: Signs, at_most: int) -> list[Diagnosis]:
    """Some diagnoses, the first ones with what their experiments showed."""
    if not signs.is_replayed:
        return list(found)
    left: list[Diagnosis] = []
    done = 0
    for one in found:
        if done >= at_most or experiment_for(one, signs) is None:
            left.append(one)
            continue
        done += 1
        after = tried(one, signs)
        left += [after] if after is not None else []
    return left
