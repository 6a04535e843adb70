"""What the panels of a flight's views are called: group, title and unit of each, in one table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from fusetune.px4.aid_sources import AID_SOURCES

INNOVATIONS, RATIOS, ATTITUDE, VELOCITY, POSITION, BIASES, WIND_AND_FIELD, UNCERTAINTY, VIBRATION, SENSORS, FLAGS = (
    GROUPS
) = (
    "Innovations",
    "Test ratios",
    "Attitude",
    "Velocity",
    "Position",
    "Biases",
    "Wind and field",
    "Uncertainty",
    "Vibration",
    "Sensors",
    "Flags",
)
"""In the order in which they are shown."""


class PanelName(NamedTuple):
    """How a panel is told."""

    group: str
    title: str
    unit: str


_NED, _FRD = ("north", "east", "down"), ("forward", "right", "down")

_AXIS_WORDS: Mapping[str, tuple[str, ...]] = {
    "velocity": _NED,
    "position": _NED,
    "field": _FRD,
    "gravity": _FRD,
    "drag": _FRD,
    "flow": ("about forward", "about right"),
}
"""By the quantity of an aid source; of others the axis needs no word."""

_PANELS: Mapping[str, tuple[str, tuple[str, ...], str]] = {
    "attitude": (ATTITUDE, ("roll", "pitch", "heading"), "°"),
    "velocity": (VELOCITY, ("velocity north", "velocity east", "velocity down"), "m/s"),
    "position": (POSITION, ("position north", "position east"), "m"),
    "height": (POSITION, ("height above the origin",), "m"),
    "gyro_bias": (BIASES, tuple(f"bias of the gyro about {one}" for one in _FRD), "rad/s"),
    "accel_bias": (BIASES, tuple(f"bias of the accelerometer {one}" for one in _FRD), "m/s²"),
    "wind": (WIND_AND_FIELD, ("wind from south to north", "wind from west to east"), "m/s"),
    "mag_earth": (WIND_AND_FIELD, tuple(f"magnetic field of the earth {one}" for one in _NED), "G"),
    "mag_body": (WIND_AND_FIELD, tuple(f"magnetic field of the vehicle {one}" for one in _FRD), "G"),
    "terrain": (WIND_AND_FIELD, ("terrain, down from the origin",), "m"),
    "attitude_sigma": (UNCERTAINTY, ("σ of tilt", "σ of heading"), "rad"),
    "velocity_sigma": (UNCERTAINTY, ("σ of horizontal velocity", "σ of vertical velocity"), "m/s"),
    "position_sigma": (UNCERTAINTY, ("σ of horizontal position", "σ of height"), "m"),
    "output_tracking": (
        UNCERTAINTY,
        (
            "output predictor behind the filter: angle",
            "output predictor behind the filter: velocity",
            "output predictor behind the filter: position",
        ),
        "",
    ),
    "accel_vibration": (VIBRATION, ("vibration of the accelerometer",), "m/s²"),
    "gyro_vibration": (VIBRATION, ("vibration of the gyro",), "rad/s"),
    "coning": (VIBRATION, ("coning of the gyro",), "rad²"),
    "clipping": (VIBRATION, ("clipped samples, counted since the start",), ""),
    "imu_temperature": (VIBRATION, ("temperature of the IMU",), "°C"),
    "gyro": (SENSORS, tuple(f"angular rate about {one}, measured" for one in _FRD), "rad/s"),
    "accel": (SENSORS, tuple(f"specific force {one}, measured" for one in _FRD), "m/s²"),
    "mag": (SENSORS, tuple(f"magnetic field {one}, measured" for one in _FRD), "G"),
    "baro_height": (SENSORS, ("height by the barometer",), "m"),
    "gnss_accuracy": (SENSORS, ("GNSS: accuracy of position, as the receiver says",), "m"),
    "gnss_speed_accuracy": (SENSORS, ("GNSS: accuracy of speed, as the receiver says",), "m/s"),
    "gnss_satellites": (SENSORS, ("GNSS: satellites used",), ""),
    "gnss_noise": (SENSORS, ("GNSS: noise and jamming, as the receiver says",), ""),
    "mag_norm": (SENSORS, ("strength of the magnetic field",), "G"),
    "range": (SENSORS, ("range finder",), "m"),
    "flow_quality": (SENSORS, ("optical flow: quality",), ""),
    "airspeed": (SENSORS, ("airspeed",), "m/s"),
    "voltage": (SENSORS, ("voltage of the battery",), "V"),
    "current": (SENSORS, ("current of the battery",), "A"),
    "resets": (FLAGS, ("resets, counted since the start",), ""),
}
"""Panel → its group, the title of each of its axes, and the unit."""

_OUTPUT_UNITS = ("rad", "m/s", "m")

RESET_WORDS: Mapping[str, str] = {
    "horizontal_position": "horizontal position",
    "height": "height",
    "horizontal_velocity": "horizontal velocity",
    "vertical_velocity": "vertical velocity",
    "heading": "heading",
}
"""What is reset, by the names of `RESET_COUNTERS`."""

STATUS_RATIOS: Mapping[str, str] = {
    "vel_test_ratio": "velocity",
    "pos_test_ratio": "position",
    "hgt_test_ratio": "height",
    "mag_test_ratio": "magnetometer",
    "hdg_test_ratio": "heading",
    "tas_test_ratio": "airspeed",
    "hagl_test_ratio": "height above ground",
    "beta_test_ratio": "sideslip",
}
"""Fields of `estimator_status`, of some release, by which the vehicle's filter sums its test ratios up."""


def panel_name(panel: str, axis: int = 0) -> PanelName:
    """Of a panel that is of no aid source."""
    group, titles, unit = _PANELS[panel]
    return PanelName(group, _begun(titles[axis]), _OUTPUT_UNITS[axis] if panel == "output_tracking" else unit)


def axes_of(panel: str) -> int:
    """How many axes it has."""
    return len(_PANELS[panel][1])


def innovation_name(source: str, axis: int) -> PanelName:
    """Of the innovations of an aid source."""
    one = AID_SOURCES[source]
    words = _AXIS_WORDS.get(one.quantity)
    title = f"{one.label} {words[axis]}" if words and one.axes > 1 else one.label
    return PanelName(INNOVATIONS, _begun(title), one.unit)


def ratio_name(source: str) -> PanelName:
    """Of the test ratios of an aid source, the largest of its axes."""
    one = AID_SOURCES[source]
    return PanelName(RATIOS, _begun(f"{one.label}, the worst axis" if one.axes > 1 else one.label), "")


def status_ratio_name() -> PanelName:
    """Of the ratios by which the vehicle's filter sums up itself."""
    return PanelName(RATIOS, "Roots of the ratios, as the vehicle's own filter sums them up", "")


def _begun(title: str) -> str:
    """With a capital in front, but for a Greek letter."""
    return title[0].upper() + title[1:] if title[0].isascii() else title
