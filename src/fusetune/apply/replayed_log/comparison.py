"""Compares a log that PX4's replay made with the log that it was made of, and with what was predicted of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.trust.onboard_fidelity import JUDGED_SOURCES, MIN_SAMPLES, partners, usable, warm_from
from fusetune.errors import UserError
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.px4.flight import Flight, ParameterValue
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, PARAMETERS, migrate
from fusetune.px4.parameters.line_files import read_parameter_file
from fusetune.px4.parameters.logged_parameters import is_read
from fusetune.px4.releases import BASELINE, Release
from fusetune.px4.ulog.reader import read_ulog
from fusetune.save.log_facts import is_airborne
from fusetune.save.replayed_release import replayed_release
from fusetune.set_names import AS_FLOWN
from fusetune.storage.files import AnyPath

AGREES_WITHIN = 0.05
"""Errors that PX4's replay made so much smaller or larger are as predicted within this share of those before."""
_SAME_SAMPLE_US = 5_000
"""How far times of one measurement may differ between replays: less than an update of the filter, 8 to 10 ms."""
_SAME_IMU_SHARE = 0.5
"""Of the samples of a replayed log at least so many are those of its original; PX4's logger drops some."""


@dataclass(frozen=True)
class ParameterBetween:
    """A parameter that differs between two logs, or that was to differ.

    Attributes
    ----------
    original, replayed : values; None where the log does not name it
    asked : what it was to be; None where nothing was asked of it
    """

    name: str
    original: ParameterValue | None
    replayed: ParameterValue | None
    asked: ParameterValue | None = None

    @property
    def is_as_asked(self) -> bool:
        """Whether the replay ran with what it was to run with."""
        return self.asked is None or (self.replayed is not None and np.float32(self.replayed) == np.float32(self.asked))


@dataclass(frozen=True)
class AxisErrors:
    """Innovations of one axis of a source over the same samples.

    Attributes
    ----------
    before, after : RMS that the vehicle logged, and PX4's replay
    our_before, our_after : the same of our replays with the parameters of either log
    nis_before, nis_after : mean of ν²/S of the vehicle and of PX4's replay
    rejected_before, rejected_after : share of samples that they rejected
    difference : RMS of the difference between PX4's replayed innovations and ours over that of PX4's
    """

    source: str
    axis: int
    samples: int
    before: float
    after: float
    our_before: float
    our_after: float
    nis_before: float
    nis_after: float
    rejected_before: float
    rejected_after: float
    difference: float

    @property
    def change(self) -> float:
        """By which share PX4's errors grew, below 0 where they shrank."""
        return self.after / self.before - 1.0

    @property
    def predicted_change(self) -> float:
        """The same of ours."""
        return self.our_after / self.our_before - 1.0

    @property
    def agrees(self) -> bool:
        """Whether PX4's errors changed as predicted."""
        return abs(self.change - self.predicted_change) <= AGREES_WITHIN


@dataclass(frozen=True)
class ReplayedLog:
    """What a replayed log says.

    Attributes
    ----------
    parameters : of the estimator that differ between the logs, or were to, by name
    errors : of each axis of the sources that are judged
    """

    original: str
    replayed: str
    parameters: tuple[ParameterBetween, ...]
    errors: tuple[AxisErrors, ...]

    @property
    def is_as_asked(self) -> bool:
        """Whether the replay ran with what it was to run with, and with nothing else."""
        asked = any(one.asked is not None for one in self.parameters)
        return all(one.is_as_asked and (one.asked is not None or not asked) for one in self.parameters)

    @property
    def agrees(self) -> bool:
        """Whether PX4's errors changed as predicted on all axes."""
        return all(one.agrees for one in self.errors)


def compare_replayed(original: AnyPath, replayed: AnyPath, asked: AnyPath | None = None) -> ReplayedLog:
    """Compare a log with the one that PX4's replay made of it.

    Parameters
    ----------
    original, replayed : ULog files
    asked : parameter file that the replay was given (``.params``, ``.parm`` or ``replay_params.txt``)

    Raises
    ------
    UserError
        A file cannot be read, the second log is no replay of the first, or they have no innovations in common.
    """
    flown, again = read_ulog(original), read_ulog(replayed)
    wanted = _asked(asked) if asked is not None else {}
    parameters = tuple(_parameters(flown, again, wanted))
    canonical_flown, canonical_again = canonical(flown), canonical(again)
    _demand_same_flight(canonical_flown, canonical_again, replayed, original)
    # PX4's replay has what was logged and nothing else, starts from nothing, and is of the release that made it
    prepared = prepare(canonical_flown, release=replayed_release(canonical_again).name)
    changed = _changed(flown, again)
    errors = tuple(_errors(prepared, canonical_again, changed))
    if not errors:
        reason = f"has no innovations at the times of those of {Path(original).name}"
        raise UserError(replayed, reason, "Replay a log with SDLOG_PROFILE bit 1, and log the replay with it")
    return ReplayedLog(flown.name, again.name, parameters, errors)


def _asked(file: AnyPath) -> dict[str, ParameterValue]:
    return {one.name: one.value for one in read_parameter_file(file)}


def _parameters(flown: Flight, again: Flight, asked: Mapping[str, ParameterValue]) -> Iterator[ParameterBetween]:
    before, after = flown.parameters.at_end(), again.parameters.at_end()
    for name in sorted({*asked, *(one for one in {**before, **after} if is_read(one))}):
        one = ParameterBetween(name, before.get(name), after.get(name), asked.get(name))
        # what a log does not name was not in use, or is what the release has by default
        held = before.get(name, _default(name, again.release))
        if (one.replayed is not None and held is not None and one.replayed != held) or one.asked is not None:
            yield one


def _default(name: str, release: Release | None) -> float | None:
    metadata = ALL_PARAMETERS.get(name)
    return metadata.default_in(release or BASELINE) if metadata is not None else None


def _changed(flown: Flight, again: Flight) -> dict[str, float]:
    """Parameters of the baseline in which the replay differs from the flight."""
    before = migrate(flown.parameters.at_end(), flown.release)
    after = migrate(again.parameters.at_end(), again.release)
    return {name: value for name, value in after.items() if value != before.get(name, PARAMETERS[name].default)}


def _demand_same_flight(flown: Flight, again: Flight, replayed: AnyPath, original: AnyPath) -> None:
    ours, theirs = flown.topic("sensor_combined"), again.topic("sensor_combined")
    if theirs is None or ours is None:
        return
    _, in_ours, in_theirs = np.intersect1d(ours["timestamp"], theirs["timestamp"], return_indices=True)
    is_same = ours["gyro_rad[0]"][in_ours] == theirs["gyro_rad[0]"][in_theirs]
    share = float(is_same.sum()) / max(theirs["timestamp"].size, 1)
    if share < _SAME_IMU_SHARE:
        reason = f"is no replay of {Path(original).name}: {share:.0%} of its IMU samples are of that log"
        raise UserError(replayed, reason, "Name the log that it was made of, which its own messages tell")


def _errors(prepared: PreparedFlight, again: Flight, changed: Mapping[str, float]) -> Iterator[AxisErrors]:
    flown = onboard_samples(prepared.flight)
    theirs = onboard_samples(again)
    ours = replay_set(prepared, AS_FLOWN, {}).samples
    ours_changed = replay_set(prepared, "replayed", changed).samples if changed else ours
    since = warm_from(ours)
    for source in JUDGED_SOURCES:
        later_us = _told_later_us(source, prepared.parameters({}), prepared.parameters(changed))
        for axis in range(3):
            key = (source, axis)
            if all(key in samples for samples in (flown, theirs, ours, ours_changed)):
                again_at, ours_at = (_shifted(one[key], later_us) for one in (theirs, ours_changed))
                one = _axis(key, prepared.flight, since, flown[key], again_at, ours[key], ours_at)
                if one is not None:
                    yield one


def _told_later_us(source: str, before: Mapping[str, float], after: Mapping[str, float]) -> int:
    """By how much more the time of a source's measurements is set back, µs: the same ones are to be compared."""
    delay = AID_SOURCES[source].delay_parameter
    return 0 if delay is None else round(1e3 * (after[delay] - before[delay]))


def _shifted(samples: AxisSamples, later_us: int) -> AxisSamples:
    return replace(samples, timestamp_sample=samples.timestamp_sample + later_us)


def _axis(
    key: SourceAxis,
    flight: Flight,
    since: int,
    flown: AxisSamples,
    *others: AxisSamples,
) -> AxisErrors | None:
    """Errors at the times of the samples in the air that the vehicle logged, as all have them."""
    before = usable(flown, since)
    before = before.rows(is_airborne(flight, before.timestamp_sample))
    sound = [usable(one) for one in others]
    if not all(one.timestamp_sample.size for one in (before, *sound)):
        return None
    matches = [partners(one.timestamp_sample, before.timestamp_sample) for one in sound]
    times = np.array([one.timestamp_sample[partner] for one, (partner, _) in zip(sound, matches, strict=True)])
    # a neighbour is no partner: where a log has lost the sample, none of the four is compared
    common = np.all([near for _, near in matches], axis=0) & (np.ptp(times, axis=0) <= _SAME_SAMPLE_US)
    if common.sum() < MIN_SAMPLES:
        return None
    before = before.rows(common)
    after, our_before, our_after = (one.rows(partner[common]) for one, (partner, _) in zip(sound, matches, strict=True))
    rms_after = _rms(after.innovation)
    return AxisErrors(
        source=key[0],
        axis=key[1],
        samples=int(common.sum()),
        before=_rms(before.innovation),
        after=rms_after,
        our_before=_rms(our_before.innovation),
        our_after=_rms(our_after.innovation),
        nis_before=_nis(before),
        nis_after=_nis(after),
        rejected_before=float(before.rejected.mean()),
        rejected_after=float(after.rejected.mean()),
        difference=_rms(our_after.innovation - after.innovation) / rms_after,
    )


def _rms(values: np.ndarray) -> float:
    # an error of nothing has no share of it
    return max(float(np.sqrt(np.mean(np.square(values)))), 1e-12)


def _nis(samples: AxisSamples) -> float:
    return float(np.mean(np.square(samples.innovation) / samples.innovation_variance))
