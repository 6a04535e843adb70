"""Estimator topics of every release in the v1.16 layout: status flags and states."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fusetune.px4.flight import Flight, TopicKey, TopicTable

_RENAMED_FLAGS = {
    "cs_gps": ("cs_gnss_pos", "cs_gnss_vel"),
    "cs_gps_yaw": ("cs_gnss_yaw",),
    "cs_gps_yaw_fault": ("cs_gnss_yaw_fault",),
}
"""Before v1.15 one flag stood for position and velocity of GNSS."""

_CONTROL_BITS = [
    "cs_tilt_align",
    "cs_yaw_align",
    "cs_gps",
    "cs_opt_flow",
    "cs_mag_hdg",
    "cs_mag_3d",
    "cs_mag_dec",
    "cs_in_air",
    "cs_wind",
    "cs_baro_hgt",
    "cs_rng_hgt",
    "cs_gps_hgt",
    "cs_ev_pos",
    "cs_ev_yaw",
    "cs_ev_hgt",
    "cs_fuse_beta",
    "cs_mag_field_disturbed",
    "cs_fixed_wing",
    "cs_mag_fault",
    "cs_fuse_aspd",
    "cs_gnd_effect",
    "cs_rng_stuck",
    "cs_gps_yaw",
    "cs_mag_aligned_in_flight",
    "cs_ev_vel",
    "cs_synthetic_mag_z",
    "cs_vehicle_at_rest",
]
"""Bits of `control_mode_flags`, from the lowest, the same from v1.8 on."""

_FAULT_BITS = [
    "fs_bad_mag_x",
    "fs_bad_mag_y",
    "fs_bad_mag_z",
    "fs_bad_hdg",
    "fs_bad_mag_decl",
    "fs_bad_airspeed",
    "fs_bad_sideslip",
    "fs_bad_optflow_x",
    "fs_bad_optflow_y",
    "fs_bad_vel_n",
    "fs_bad_vel_e",
    "fs_bad_vel_d",
    "fs_bad_pos_n",
    "fs_bad_pos_e",
    "fs_bad_pos_d",
    "fs_bad_acc_bias",
    "fs_bad_acc_vertical",
    "fs_bad_acc_clipping",
]
"""Bits of `filter_fault_flags` in the releases that had no `estimator_status_flags` yet."""

_REJECT_BITS = [
    "reject_hor_vel",
    "reject_ver_vel",
    "reject_hor_pos",
    "reject_ver_pos",
    "reject_mag_x",
    "reject_mag_y",
    "reject_mag_z",
    "reject_yaw",
    "reject_airspeed",
    "reject_sideslip",
    "reject_hagl",
    "reject_optflow_x",
    "reject_optflow_y",
]
"""Bits of `innovation_check_flags` from v1.11 on; before, one bit stood for velocity in all directions."""
_SPLIT_VELOCITY = "pre_flt_fail_innov_heading"
"""A field of `estimator_status` that came with v1.11, as the two bits did."""


def control_bits(flags: Iterable[str]) -> int:
    """Bits of `estimator_status.control_mode_flags` that stand for flags of v1.16; 0 where it has none of them."""
    before = {new: old for old, names in _RENAMED_FLAGS.items() for new in names}
    names = {before.get(flag, flag) for flag in flags}
    return sum(1 << bit for bit, name in enumerate(_CONTROL_BITS) if name in names)


def status_flags(table: TopicTable) -> TopicTable:
    """`estimator_status_flags` with the names of v1.16 beside those of the log."""
    result = dict(table)
    for old, new_names in _RENAMED_FLAGS.items():
        for new in new_names:
            if old in table and new not in table:
                result[new] = table[old]
    return result


def status_flags_of_status(table: TopicTable) -> TopicTable | None:
    """`estimator_status_flags` from the bit fields of `estimator_status` (releases before v1.12)."""
    if "control_mode_flags" not in table:
        return None
    time = table["timestamp"]
    flags: TopicTable = {"timestamp": time, "timestamp_sample": table.get("timestamp_sample", time)}
    for field, names in (("control_mode_flags", _CONTROL_BITS), ("filter_fault_flags", _FAULT_BITS)):
        if field in table:
            bits = table[field].astype(np.int64)
            flags.update({name: (bits >> bit & 1).astype(np.bool_) for bit, name in enumerate(names)})
    return status_flags(flags | _rejections(table))


def _rejections(table: TopicTable) -> TopicTable:
    """Flags of what was rejected; a rejected velocity of before v1.11 counts as horizontal and vertical."""
    if "innovation_check_flags" not in table:
        return {}
    bits = table["innovation_check_flags"].astype(np.int64)
    if _SPLIT_VELOCITY not in table:
        bits = bits & 1 | bits << 1
    return {name: (bits >> bit & 1).astype(np.bool_) for bit, name in enumerate(_REJECT_BITS)}


def states_of_status(table: TopicTable) -> TopicTable | None:
    """`estimator_states` from `estimator_status` of releases that held the states there."""
    if "states[0]" not in table:
        return None
    time = table["timestamp"]
    columns = {name: values for name, values in table.items() if name.startswith(("states[", "covariances["))}
    return {"timestamp": time, "timestamp_sample": table.get("timestamp_sample", time), **columns}


def estimator_tables(flight: Flight) -> dict[TopicKey, TopicTable]:
    """Estimator topics that the log lacks or names otherwise, for each estimator instance."""
    tables: dict[TopicKey, TopicTable] = {
        ("estimator_status_flags", instance): status_flags(flight.topics["estimator_status_flags", instance])
        for instance in flight.instances("estimator_status_flags")
    }
    for instance in flight.instances("estimator_status"):
        status = flight.topics["estimator_status", instance]
        derived = {"estimator_status_flags": status_flags_of_status, "estimator_states": states_of_status}
        for topic, function in derived.items():
            table = None if flight.topic(topic, instance) is not None else function(status)
            if table is not None:
                tables[topic, instance] = table
    return tables
