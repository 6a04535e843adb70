"""Which parameters of a set can act on a flight at all; the others are named "inactive on this flight".

GNSS noise parameters are floors below the receiver's own accuracy, and a source that the vehicle lacks makes its
parameters idle: a sweep of such a parameter changes nothing, and must not look like a finding.
"""

from collections.abc import Callable

import numpy as np

from fusetune.analyze.set_files import SetRecord
from fusetune.px4.flight import Flight

_REQUIRED_SOURCES: dict[str, tuple[str, ...]] = {
    "EKF2_GPS_": ("gnss_pos", "gnss_vel", "gnss_hgt"),
    "EKF2_BARO_": ("baro_hgt",),
    "EKF2_GND_EFF_DZ": ("baro_hgt",),
    "EKF2_RNG_": ("rng_hgt",),
    "EKF2_MAG_": ("mag",),
    "EKF2_HEAD_NOISE": ("mag", "gnss_yaw"),
    "EKF2_EVP_": ("ev_pos", "ev_hgt"),
    "EKF2_EVV_": ("ev_vel",),
    "EKF2_EVA_": ("ev_yaw",),
    "EKF2_EV_": ("ev_pos", "ev_vel", "ev_hgt", "ev_yaw"),
    "EKF2_OF_": ("optical_flow",),
    "EKF2_TAS_GATE": ("airspeed",),
    "EKF2_EAS_NOISE": ("airspeed",),
    "EKF2_ASP_DELAY": ("airspeed",),
    "EKF2_BETA_": ("sideslip",),
    "EKF2_DRAG_": ("drag",),
    "EKF2_BCOEF_": ("drag",),
    "EKF2_MCOEF": ("drag",),
    "EKF2_GRAV_NOISE": ("gravity",),
    "EKF2_AGP_": ("aux_global_position",),
    "EKF2_AVEL_DELAY": ("aux_vel",),
}
"""Start of a parameter's name → sources of which at least one must be there for it to act."""

_NOISE_FLOORS = {"EKF2_GPS_P_NOISE": ("eph", "m"), "EKF2_GPS_V_NOISE": ("s_variance_m_s", "m/s")}
"""Parameter → the receiver's accuracy in `vehicle_gps_position` below which it has no effect, and its unit."""

_NEGLIGIBLE_SHARE = 0.02


def inactive_parameters(record: SetRecord, present: SetRecord, flight: Flight) -> dict[str, str]:
    """Overrides of a set that cannot act on this flight, each with the reason in words.

    Parameters
    ----------
    record, present : replays of this flight with the set and with the present set
    flight : needs `vehicle_gps_position` for the receiver's accuracy
    """
    checks: tuple[Callable[[str], str], ...] = (
        lambda name: _same_value(name, record, present),
        lambda name: _absent_source(name, record, present),
        lambda name: _below_receiver_accuracy(name, record, present, flight),
    )
    reasons: dict[str, str] = {}
    for name in sorted(record.overrides):
        for check in checks:
            reason = check(name)
            if reason:
                reasons[name] = reason
                break
    return reasons


def same_results(record: SetRecord, present: SetRecord) -> bool:
    """True where two replays agree in every innovation and variance: the sets are one on this flight."""
    if record.samples.keys() != present.samples.keys():
        return False
    return all(
        np.array_equal(one.innovation, present.samples[key].innovation, equal_nan=True)
        and np.array_equal(one.innovation_variance, present.samples[key].innovation_variance, equal_nan=True)
        for key, one in record.samples.items()
    )


def _same_value(name: str, record: SetRecord, present: SetRecord) -> str:
    value, before = record.parameters.get(name), present.parameters.get(name)
    if value is None or before is None or np.float32(value) != np.float32(before):
        return ""
    return "has the same value in the present set"


def _absent_source(name: str, record: SetRecord, present: SetRecord) -> str:
    for prefix in sorted(_REQUIRED_SOURCES, key=len, reverse=True):
        if not name.startswith(prefix):
            continue
        sources = _REQUIRED_SOURCES[prefix]
        return (
            ""
            if (_fused_sources(record) | _fused_sources(present)).intersection(sources)
            else f"no {' or '.join(sources)} was fused on this flight"
        )
    return ""


def _fused_sources(record: SetRecord) -> set[str]:
    return {source for (source, _), samples in record.samples.items() if samples.fused.any()}


def _below_receiver_accuracy(name: str, record: SetRecord, present: SetRecord, flight: Flight) -> str:
    if name not in _NOISE_FLOORS:
        return ""
    field, unit = _NOISE_FLOORS[name]
    table = flight.topic("vehicle_gps_position")
    if table is None or field not in table or table[field].size == 0:
        return ""
    largest_floor = max(record.parameters[name], present.parameters.get(name, 0.0))
    accuracy = table[field].astype(np.float64)
    if np.mean(accuracy < largest_floor) > _NEGLIGIBLE_SHARE:
        return ""
    return (
        f"is a floor of {record.parameters[name]:g} {unit}, and the receiver reports "
        f"{np.median(accuracy):.2g} {unit} (median), so it has no effect"
    )
