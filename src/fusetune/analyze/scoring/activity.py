"""Which parameters of a set can act on a flight at all; the others are named "inactive on this flight".

GNSS noise parameters are floors below the receiver's own accuracy, a source that the vehicle lacks makes its
parameters idle, and a gate that no sample reaches might as well be another: a sweep of such a parameter changes
nothing, and must not look like a finding.
"""

from collections.abc import Callable

import numpy as np

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.px4.flight import Flight
from fusetune.px4.parameter_sources import observation_noise_of, required_sources, switched_off

_NEGLIGIBLE_SHARE = 0.02


def inactive_parameters(record: ReplayedSet, present: ReplayedSet, flight: Flight) -> dict[str, str]:
    """Overrides of a set that cannot act on this flight, each with the reason in words.

    Parameters
    ----------
    record, present : replays of this flight with the set and with the present set
    flight : needs `vehicle_gps_position` for the receiver's accuracy
    """
    unchanged = same_results(record, present)
    checks: tuple[Callable[[str], str], ...] = (
        lambda name: _same_value(name, record, present),
        lambda name: _absent_source(name, record, present),
        lambda name: _below_receiver_accuracy(name, record, present, flight),
        lambda name: _same_observation_variance(name, record, present),
        lambda name: _idle_gate(name, record, present),
        lambda name: "every innovation is the same as with the present value" if unchanged else "",
    )
    reasons: dict[str, str] = {}
    for name in sorted(record.overrides):
        for check in checks:
            reason = check(name)
            if reason:
                reasons[name] = reason
                break
    return reasons


def same_results(record: ReplayedSet, present: ReplayedSet) -> bool:
    """True where two replays agree in every innovation and variance: the sets are one on this flight."""
    if record.samples.keys() != present.samples.keys():
        return False
    return all(_same_samples(record.samples[key], present.samples[key]) for key in record.samples)


def _same_samples(one: AxisSamples, other: AxisSamples) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name in ("innovation", "innovation_variance")
    )


def _same_value(name: str, record: ReplayedSet, present: ReplayedSet) -> str:
    value, before = record.parameters.get(name), present.parameters.get(name)
    if value is None or before is None or np.float32(value) != np.float32(before):
        return ""
    return "has the same value in the present set"


def _absent_source(name: str, record: ReplayedSet, present: ReplayedSet) -> str:
    sources = required_sources(name)
    if not sources or (record.fused_sources | present.fused_sources).intersection(sources):
        return ""
    causes = [{switched_off(source, one.parameters) for source in sources} for one in (record, present)]
    # Only what keeps every one of the sources out, in both replays, is the cause.
    switches = sorted(set.union(*causes)) if all(cause and "" not in cause for cause in causes) else []
    why = f" ({', '.join(switches)})" if switches else ""
    return f"no {' or '.join(sources)} was fused on this flight{why}"


def _below_receiver_accuracy(name: str, record: ReplayedSet, present: ReplayedSet, flight: Flight) -> str:
    table = flight.topic("vehicle_gps_position")
    floors = [(one, floor) for one in AID_SOURCES.values() for floor in one.noise_floors if floor.parameter == name]
    if not floors or table is None:
        return ""
    largest_floor = max(record.parameters[name], present.parameters.get(name, 0.0))
    fused = record.fused_sources | present.fused_sources
    reported = []
    for source, floor in floors:
        if source.name not in fused:
            continue
        if floor.field not in table or table[floor.field].size == 0:
            return ""
        accuracy = table[floor.field].astype(np.float64)
        if np.mean(accuracy < floor.factor * largest_floor) > _NEGLIGIBLE_SHARE:
            return ""
        reported.append(float(np.median(accuracy)))
    if not reported:
        return ""
    unit = floors[0][0].unit
    return (
        f"is a floor of {record.parameters[name]:g} {unit}, and the receiver reports "
        f"{' and '.join(f'{value:.2g}' for value in reported)} {unit} (median), so it has no effect"
    )


def _same_observation_variance(name: str, record: ReplayedSet, present: ReplayedSet) -> str:
    """A noise that is a floor, or that another figure overrides, leaves the observation variances as they were."""
    keys = [key for key in record.samples if key[0] in observation_noise_of(name)]
    keys = [key for key in keys if key in present.first_fused]
    if not keys:
        return ""
    for key in keys:
        one, other = record.samples[key], present.samples[key]
        if not np.array_equal(one.observation_variance, other.observation_variance, equal_nan=True):
            return ""
    return "leaves every observation variance as it is: what the sensor reports is larger"


def _idle_gate(name: str, record: ReplayedSet, present: ReplayedSet) -> str:
    if not name.endswith("_GATE"):
        return ""
    largest = 0.0
    for one in (record, present):
        for key in one.first_fused:
            if AID_SOURCES[key[0]].gate_parameter != name:
                continue
            samples = one.samples[key]
            started = np.cumsum(samples.fused) > 0
            if samples.rejected[started].any():
                return ""
            with np.errstate(invalid="ignore", divide="ignore"):
                beyond = np.abs(samples.innovation) / np.sqrt(samples.innovation_variance)
            largest = max(largest, float(np.nanmax(beyond[started])))
    gates = [max(one.parameters.get(name, 0.0), 1.0) for one in (record, present)]
    if not 0.0 < largest < min(gates):
        return ""
    return f"no sample lies further out than {largest:.1f} standard deviations, so the gate never binds"
