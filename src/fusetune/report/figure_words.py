"""What the figures of the health table are called, for people."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.px4.aid_sources import AID_SOURCES

_OF_RATIOS: Mapping[str, str] = {
    "raised_share": "share of test ratios above 0.5",
    "amber_share": "share of test ratios in (0.5, 1]",
    "red_share": "share of test ratios above 1",
    "mean_ratio": "mean test ratio",
    "max_ratio": "largest test ratio",
    "worst_ratio": "mean test ratio of the worst 30 s",
    "rejected_share": "share of rejected samples",
    "longest_unfused_s": "longest time without fusion",
}
_OF_SENSORS: Mapping[str, str] = {
    "rate_hz": "samples a second",
    "longest_gap_s": "longest gap in flight",
    "logged_share": "share of the flight that the log covers",
    "stuck_s": "longest time that it stands still in flight",
    "accel_errors": "errors of the accelerometer's driver",
    "accel_rate_hz": "rate of the accelerometer",
    "gyro_errors": "errors of the gyro's driver",
    "gyro_rate_hz": "rate of the gyro",
    "count": "in the log",
    "accuracy_ratio": "ratio of their accuracies",
}
_OF_STATES: Mapping[str, str] = {
    "horizontal_position": "horizontal position",
    "height": "height",
    "horizontal_velocity": "horizontal velocity",
    "vertical_velocity": "vertical velocity",
    "heading": "heading",
}
_REJECTED: Mapping[str, str] = {
    "hor_vel": "horizontal velocity",
    "ver_vel": "vertical velocity",
    "hor_pos": "horizontal position",
    "ver_pos": "vertical position",
    "yaw": "heading",
    "airspeed": "airspeed",
    "sideslip": "sideslip",
    "hagl": "height above ground",
    "optflow_x": "optical flow x",
    "optflow_y": "optical flow y",
    "mag_x": "magnetometer x",
    "mag_y": "magnetometer y",
    "mag_z": "magnetometer z",
}

_SUBJECTS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "flight": (
        "flight",
        {"take_off_s": "take-off", "landing_s": "end", "airborne_s": "time in the air"},
    ),
    "instances": (
        "estimator instances",
        {
            "count": "in the log",
            "primary_share": "share of the time as the primary one",
            "switches": "changes of the primary one in flight",
            "whipsaw": "most changes within 10 s",
        },
    ),
    "aiding": (
        "horizontal aiding",
        {"longest_unaided_s": "longest time without any", "unflagged_loss_s": "longest loss that the filter hides"},
    ),
    "status_height": ("height as the filter sums it up", _OF_RATIOS),
    "status_heading": ("heading as the filter sums it up", _OF_RATIOS),
    "status_velocity": ("velocity as the filter sums it up", _OF_RATIOS),
    "status_position": ("position as the filter sums it up", _OF_RATIOS),
    "status_airspeed": ("airspeed as the filter sums it up", _OF_RATIOS),
    "status_hagl": ("height above ground as the filter sums it up", _OF_RATIOS),
    "rejections": ("share of the flight rejected", {f"{name}_share": words for name, words in _REJECTED.items()}),
    "filter": ("filter", {"faults": "fault flags", "time_slip_s": "IMU time lost in flight"}),
    "alignment": ("alignment", {"tilt_s": "tilt known after", "yaw_s": "heading known after"}),
    "resets": ("resets, clear of the ground", _OF_STATES),
    "local_position_resets": ("resets of the position in use", _OF_STATES),
    "bias": (
        "bias",
        {
            "gyro": "gyro",
            "gyro_change": "change of the gyro's in flight",
            "gyro_at_limit_share": "share of the time with the gyro's at its limit",
            "accel": "accelerometer",
            "accel_change": "change of the accelerometer's in flight",
            "accel_at_limit_share": "share of the time with the accelerometer's at its limit",
        },
    ),
    "output_predictor": (
        "output predictor",
        {
            "angle_error_rad": "median error of angle",
            "velocity_error_m_s": "median error of velocity",
            "position_error_m": "median error of position",
        },
    ),
    "vibration": (
        "vibration",
        {
            "accel_mean": "mean high-frequency acceleration",
            "accel_peak": "largest high-frequency acceleration",
            "gyro_mean": "mean high-frequency angular rate",
            "gyro_peak": "largest high-frequency angular rate",
            "coning_mean": "mean coning",
            "coning_peak": "largest coning",
        },
    ),
    "clipping": ("clipped samples, clear of the ground", {"accel": "accelerometer", "gyro": "gyro"}),
    "gnss": (
        "GNSS",
        {
            "checks_failed_share": "share of the time in which EKF2's checks failed",
            "drift_horizontal": "horizontal drift at rest",
            "drift_vertical": "vertical drift at rest",
            "eph": "horizontal accuracy",
            "epv": "vertical accuracy",
            "fix_type": "fix type",
            "jamming_indicator": "jamming indicator",
            "jamming_state": "jamming as the receiver sees it",
            "noise_per_ms": "noise",
            "pdop": "PDOP",
            "satellites": "satellites",
            "speed_accuracy": "speed accuracy",
            "speed_at_rest": "horizontal speed at rest",
            "spoofing_state": "spoofing as the receiver sees it",
        },
    ),
    "receivers": ("GNSS receivers", _OF_SENSORS),
    "imu": ("IMU", _OF_SENSORS),
    "baro": ("barometer", _OF_SENSORS),
    "gps": ("GNSS", _OF_SENSORS),
    "height": ("height, its fastest source", _OF_SENSORS),
    "range": ("range finder", _OF_SENSORS),
    "flow": ("optical flow", _OF_SENSORS),
    "vision": ("external vision", _OF_SENSORS),
}
_MAGNETOMETER_AND_AIRSPEED: Mapping[str, str] = {**_OF_RATIOS, **_OF_SENSORS}
"""Aid source and sensor have one name."""


def figure_words(figure: str) -> str:
    """What a figure is called, from its id `<subject>.<figure>`; of one that has no words here, the id's own."""
    subject, _, name = figure.partition(".")
    label, names = _SUBJECTS.get(subject) or (_aid_source_label(subject), _MAGNETOMETER_AND_AIRSPEED)
    return f"{label or _spelled(subject)}: {names.get(name) or _spelled(name)}"


def has_words(figure: str) -> bool:
    """Whether there are words for a figure."""
    subject, _, name = figure.partition(".")
    return name in (_SUBJECTS[subject][1] if subject in _SUBJECTS else _MAGNETOMETER_AND_AIRSPEED) and (
        subject in _SUBJECTS or bool(_aid_source_label(subject))
    )


def _aid_source_label(subject: str) -> str:
    """Of a source, or of one of its groups of axes: `gnss_vel_horizontal`."""
    if subject in AID_SOURCES:
        return AID_SOURCES[subject].label
    name, _, group = subject.rpartition("_")
    return f"{AID_SOURCES[name].label}, {group}" if name in AID_SOURCES else ""


def _spelled(name: str) -> str:
    return name.replace("_", " ")
