"""Releases of PX4: those that are read, those whose estimators differ, and what only the number of a release tells.

Most of what differs between releases a log tells itself, by the topics and fields that it has (`px4/layouts/`); the
parameters of each stand in `px4/parameters/ekf2_parameters.csv`. Here stands the rest: from which release on PX4 does
otherwise without its logs showing it.
"""

from __future__ import annotations

from typing import Literal, get_args

Release = tuple[int, int] | tuple[int, int, int]
"""Major and minor number, and the patch where it is known; without it, before all patches of its minor number."""

FIRST, NEWEST = (1, 8), (1, 17)
"""Logs are read of these releases and of all between them."""

READ = tuple((FIRST[0], minor) for minor in range(FIRST[1], NEWEST[1] + 1))

BASELINE = (1, 16)
"""The release whose topics and parameters are the ones that count; its estimator is the plain text of the kernels."""

DEVELOPMENT = (NEWEST[0], NEWEST[1] + 1)
"""What `main` counts as."""

AUTO = "auto"
"""The release that flew, or the nearest to it that is modelled."""

ReleaseChoice = Literal["auto", "v1.13", "v1.14", "v1.15", "v1.16", "v1.17", "main"]
"""How people say which release's estimator replays a flight."""

ESTIMATORS: tuple[str, ...] = tuple(name for name in get_args(ReleaseChoice) if name != AUTO)
"""Releases whose estimators differ, from the oldest to the newest; `main` is PX4's development branch."""

CLIPPING_COUNTED = (1, 11)
"""Since then the IMU samples count clipped ones."""

VALIDATED_AIRSPEED = (1, 13)
"""Since then EKF2 reads `airspeed_validated`, before the raw sensor alone."""

AIRSPEED_SELECTED = (1, 14)
"""Since then it asks whether a sensor is selected there."""

GNSS_VELOCITY_VALID = (1, 14)
"""Since then (November 2022) GNSS without valid velocity is dropped; before, `vel_ned_valid` decided nothing."""

VISION_FRAMES = (1, 14)
"""Since then vision of unknown frame is dropped, and quaternions that are no unit; before, any number was used."""

ALL_HEIGHT_SOURCES = (1, 14)
"""Since then EKF2 takes the height from all sources that are enabled, before from one at a time."""

CONTROL_BY_SOURCE = (1, 14)
"""Since then each aid source has a parameter of its own, before EKF2_AID_MASK and EKF2_HGT_MODE had them all."""

SENSOR_RATES_UNREAD = (1, 15)
"""Since then EKF2 sizes its buffers by EKF2_DELAY_MAX, before by the rates of the sensors and their delays."""

NO_MAG_HEADING = (1, 15)
"""Since then no heading of the magnetometer is fused: `heading` then holds its largest field innovation."""

MAG_TYPES_GIVEN_UP = (1, 15)
"""Since then EKF2_MAG_TYPE is automatic, heading, none or initial; before, 3D and indoor as well."""

VERBOSE_LOG = (1, 16)
"""Since then EKF2_LOG_VERBOSE asks for what replays are compared with."""

MAIN = "main"

DEVIATIONS = (
    ((1, 13), "its EKF2 took the height from one source at a time and had its own logic for heading and GNSS"),
    ((1, 14), "its EKF2 had another error state and fused the magnetometer's heading on its own"),
    ((1, 15), "its EKF2 kept the terrain in a filter of its own and is else nearly the same"),
    (DEVELOPMENT, "its EKF2 is newer"),
)
"""Last release, and how its estimator differs from the baseline's, for people."""


def name_of(release: Release) -> str:
    """As PX4 writes it, e.g. ``"v1.16"``."""
    return "v" + ".".join(map(str, release))


def estimator_name(release: Release) -> str:
    """A release without its patch, as `ESTIMATORS` names it: ``"v1.16"``; ``"main"`` for what is newer than all."""
    return MAIN if release[:2] >= DEVELOPMENT else name_of(release[:2])


def number_of_name(name: str) -> tuple[int, int]:
    """The other way round: the major and minor number of ``"v1.16"``, or what `main` counts as."""
    if name == MAIN:
        return DEVELOPMENT
    major, minor = name.removeprefix("v").split(".")
    return int(major), int(minor)


def name_of_version(version: int) -> str:
    """A release with its stage, of PX4's number for it: a byte each for major, minor, patch and stage.

    So it stands in a log's `ver_sw_release` and in MAVLink's `flight_sw_version`: ``"v1.13.3"``, ``"v1.15.0-beta"``.
    """
    major, minor, patch, stage = (version >> shift & 0xFF for shift in (24, 16, 8, 0))
    suffix = "" if stage == 255 else "-rc" if stage >= 192 else "-beta" if stage >= 128 else "-alpha"
    return f"{name_of((major, minor, patch))}{'-dev' if stage < 64 else suffix}"


def deviation_of(release: Release, replayed: Release = BASELINE) -> str:
    """How the estimator of a release differs from that of another one that replays it, in words; empty where it is it.

    Without the other the baseline's is meant.
    """
    if release[:2] == replayed[:2]:
        return ""
    if replayed[:2] != BASELINE:
        return f"its EKF2 is {'newer' if release[:2] > replayed[:2] else 'older'}"
    return next((words for last, words in DEVIATIONS if release[:2] <= last), DEVIATIONS[-1][1])
