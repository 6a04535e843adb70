"""What else than its number tells which release wrote a log: parameters and fields that only some releases have.

Development builds carry the number of the release before or after, and builds of vendors one of their own, so the
number says less than what the firmware knows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fusetune.px4.flight import TopicKey, TopicTable
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS
from fusetune.px4.releases import DEVELOPMENT, FIRST, Release

Span = tuple[Release, Release]
"""The first and the last release that have something."""

FLAGS_TOPIC = "estimator_status_flags"

_CAME: Mapping[Release, tuple[str, ...]] = {
    (1, 14): ("cs_fake_hgt", "cs_fake_pos", "cs_gravity_vector"),
    (1, 15): ("cs_aux_gpos", "cs_ev_yaw_fault", "cs_mag", "cs_mag_heading_consistent"),
    (1, 16): (
        *("cs_baro_fault", "cs_constant_pos", "cs_gnss_pos", "cs_gnss_vel", "cs_gnss_yaw", "cs_gnss_yaw_fault"),
        *("cs_opt_flow_terrain", "cs_rng_terrain", "cs_valid_fake_pos"),
    ),
    (1, 17): ("cs_gnss_fault", "cs_gnss_hgt_fault", "cs_yaw_manual"),
    DEVELOPMENT: ("cs_heading_observable", "cs_in_transition"),
}
_WENT: Mapping[Release, tuple[str, ...]] = {
    (1, 13): ("reject_mag_x", "reject_mag_y", "reject_mag_z"),
    (1, 14): ("fs_bad_pos_d", "fs_bad_pos_e", "fs_bad_pos_n", "fs_bad_vel_d", "fs_bad_vel_e", "fs_bad_vel_n"),
    (1, 15): ("cs_gps", "cs_gps_yaw", "cs_gps_yaw_fault", "fs_bad_acc_bias"),
    (1, 17): ("reject_airspeed", "reject_hagl", "reject_hor_pos", "reject_hor_vel", "reject_yaw"),
}

FLAG_SPANS: Mapping[str, Span] = {
    **{name: (first, DEVELOPMENT) for first, names in _CAME.items() for name in names},
    **{name: (FIRST, last) for last, names in _WENT.items() for name in names},
}
"""Fields of `estimator_status_flags` → releases that have them. Source: PX4's `msg/EstimatorStatusFlags.msg`."""


def flag_signs(topics: Mapping[TopicKey, TopicTable]) -> tuple[str, ...]:
    """The flags that tell releases apart, of a log's topics as they were logged; sorted."""
    logged = (table for (topic, _), table in topics.items() if topic == FLAGS_TOPIC)
    return tuple(sorted({name for table in logged for name in table if name in FLAG_SPANS}))


def spans_of(parameters: Iterable[str], flags: Iterable[str]) -> dict[str, Span]:
    """Releases that have each of a log's parameters and flags, as far as they are known."""
    known = (ALL_PARAMETERS[name] for name in parameters if name in ALL_PARAMETERS)
    spans: dict[str, Span] = {one.name: (one.first_release, one.last_release) for one in known}
    return spans | {name: FLAG_SPANS[name] for name in flags if name in FLAG_SPANS}


def strangers(spans: Mapping[str, Span], release: Release) -> tuple[str, ...]:
    """What a release does not have."""
    return tuple(name for name, (first, last) in spans.items() if not first <= release[:2] <= last)
