"""What the sensors themselves say: vibration, barometer, GNSS quality, field, range, flow, airspeed, battery."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fusetune.analyze.replaying.replayed_set import RESET_COUNTERS
from fusetune.px4.flight import TopicTable, field_names, stacked
from fusetune.px4.layouts.vibration_metrics import vibrations
from fusetune.report.flight_data.content import Figures, Panel, Series, with_gaps
from fusetune.report.flight_data.logged import Logged
from fusetune.report.flight_data.panel_names import (
    RATIOS,
    RESET_WORDS,
    STATUS_RATIOS,
    axes_of,
    panel_name,
    status_ratio_name,
)

_MOST_INSTANCES = 4
_STATES = {"jamming_state": "jamming state (3: critical)", "spoofing_state": "spoofing state (2: indicated)"}
"""Of the receiver: 0 says that it does not tell, 1 that there is none."""
_GAUSS_AXES = 3


def status_ratio_panel(logged: Logged) -> Iterator[Panel]:
    """The test ratios of `estimator_status`: of each kind the largest, low-pass filtered from v1.15 on."""
    status = logged.of_primary("estimator_status")
    # what is not fused has zero throughout
    series = tuple(one for one in _fields(status, STATUS_RATIOS) if np.any(one.values > 0.0))
    if series:
        name = status_ratio_name()
        yield Panel("ratio.status", RATIOS, name.title, name.unit, series, "ratio", log=True, limit=1.0)


def output_tracking_panels(logged: Logged) -> Iterator[Panel]:
    """By how much the output predictor lags behind the filter."""
    status = logged.of_primary("estimator_status")
    for axis in range(axes_of("output_tracking")):
        yield from _panel("output_tracking", _fields(status, {f"output_tracking_error[{axis}]": "as flown"}), axis)


def vibration_panels(logged: Logged, health: Sequence[Mapping[str, Any]]) -> Iterator[Panel]:
    """Metrics of each IMU, clipping and temperature.

    Parameters
    ----------
    health : rows of the health table, whose limits are drawn
    """
    found = vibrations(logged.raw)[:_MOST_INSTANCES]
    for metric in ("accel", "gyro", "coning"):
        series = (
            _series(_imu(one.imu), one.time, values)
            for one in found
            if (values := getattr(one, metric)) is not None and np.any(values)
        )
        panel = "coning" if metric == "coning" else f"{metric}_vibration"
        yield from _panel(panel, series, limit=_limit(health, f"vibration.{metric}_peak"))
    status = _instances(logged, "vehicle_imu_status")
    yield from _panel("clipping", (one for name, table in status for one in _clipping(name, table)))
    yield from _panel("imu_temperature", _each(status, "temperature_accel"))


def sensor_panels(logged: Logged, health: Sequence[Mapping[str, Any]], earth_field: Series | None) -> Iterator[Panel]:
    """Of each sensor what tells how good it is.

    Parameters
    ----------
    health : rows of the health table, whose limits are drawn
    earth_field : strength of the earth's field as the filter holds it
    """
    combined = logged.raw.topic("sensor_combined")
    for panel, field in (("gyro", "gyro_rad"), ("accel", "accelerometer_m_s2")):
        for axis in range(axes_of(panel)):
            yield from _panel(panel, _fields(combined, {f"{field}[{axis}]": "IMU in use"}), axis)
    for axis in range(axes_of("mag")):
        measured = _fields(logged.topic("vehicle_magnetometer"), {f"magnetometer_ga[{axis}]": "magnetometer in use"})
        yield from _panel("mag", measured, axis)
    yield from _panel("baro_height", _fields(logged.topic("vehicle_air_data"), {"baro_alt_meter": "barometer"}))
    gnss = logged.topic("vehicle_gps_position")
    yield from _panel(
        "gnss_accuracy", _fields(gnss, {"eph": "horizontal", "epv": "vertical"}), 0, _limit(health, "gnss.eph")
    )
    yield from _panel(
        "gnss_speed_accuracy", _fields(gnss, {"s_variance_m_s": "speed"}), 0, _limit(health, "gnss.speed_accuracy")
    )
    counted = {"satellites_used": "satellites", "fix_type": "fix type (3: three-dimensional)"}
    yield from _panel("gnss_satellites", _fields(gnss, counted, is_step=True))
    noise = {"noise_per_ms": "noise per ms", "jamming_indicator": "jamming indicator", **_STATES}
    yield from _panel("gnss_noise", (one for one in _fields(gnss, noise) if np.any(one.values)))
    yield from _panel("mag_norm", [*_field_strengths(logged), *([] if earth_field is None else [earth_field])])
    distances = _each(_instances(logged, "distance_sensor"), "current_distance")
    yield from _panel("range", distances)
    yield from _panel("flow_quality", _fields(logged.topic("vehicle_optical_flow"), {"quality": "quality"}))
    speeds = {"true_airspeed_m_s": "true airspeed", "calibrated_airspeed_m_s": "calibrated airspeed"}
    indicated = {"true_airspeed_m_s": "true airspeed", "indicated_airspeed_m_s": "indicated airspeed"}
    validated = _fields(logged.topic("airspeed_validated"), speeds)
    yield from _panel("airspeed", validated or _fields(logged.topic("airspeed"), indicated))
    battery = logged.topic("battery_status")
    yield from _panel("voltage", _fields(battery, {"voltage_v": "voltage"}))
    yield from _panel("current", _fields(battery, {"current_a": "current"}))


def reset_panel(logged: Logged) -> Iterator[Panel]:
    """Resets of the position that the vehicle flew by, counted since the log began."""
    local = logged.topic("vehicle_local_position")
    series = []
    for kind, counter in RESET_COUNTERS.items():
        if local is not None and counter in local:
            counts = local[counter].astype(np.int64)
            steps = np.subtract(counts[1:], counts[:-1]) & 0xFF
            if steps.any():
                series.append(_stepped(RESET_WORDS[kind], local["timestamp"], np.r_[0, np.cumsum(steps)]))
    yield from _panel("resets", series)


def _instances(logged: Logged, topic: str) -> list[tuple[str, TopicTable]]:
    found = []
    for instance in logged.flight.instances(topic)[:_MOST_INSTANCES]:
        table = logged.topic(topic, instance)
        if table is not None:
            found.append((_imu(instance) if topic.startswith("vehicle_imu") else f"instance {instance}", table))
    return found


def _imu(instance: int | None) -> str:
    return "IMU in use" if instance is None else f"IMU {instance}"


def _clipping(name: str, table: TopicTable) -> Iterator[Series]:
    for kind, label in (("accel", "accelerometer"), ("gyro", "gyro")):
        names = field_names(table, f"{kind}_clipping")
        total = np.sum([table[one].astype(np.int64) for one in names], axis=0) if names else np.zeros(0)
        if total.size and total[-1] != total[0]:
            yield _stepped(f"{name}, {label}", table["timestamp"], total - total[0])


def _field_strengths(logged: Logged) -> Iterator[Series]:
    table = logged.topic("vehicle_magnetometer")
    if table is not None and f"magnetometer_ga[{_GAUSS_AXES - 1}]" in table:
        strength = np.linalg.norm(stacked(table, "magnetometer_ga"), axis=1)
        yield _series("measured", table["timestamp"], strength)
    status = logged.of_primary("estimator_status")
    if status is not None and "mag_strength_ref_gs" in status:
        yield _series(
            "the world's model, as the vehicle's filter has it", status["timestamp"], status["mag_strength_ref_gs"]
        )


def _fields(table: TopicTable | None, fields: Mapping[str, str], *, is_step: bool = False) -> tuple[Series, ...]:
    """A series of each field that the table has."""
    if table is None:
        return ()
    make = _stepped if is_step else _series
    found = (make(label, table["timestamp"], table[name]) for name, label in fields.items() if name in table)
    return tuple(one for one in found if np.any(np.isfinite(one.values)))


def _each(tables: Sequence[tuple[str, TopicTable]], field: str) -> Iterator[Series]:
    for name, table in tables:
        if field in table and np.any(np.isfinite(table[field])):
            yield _series(name, table["timestamp"], table[field])


def _stepped(label: str, time: Figures, values: Figures) -> Series:
    """What holds until it changes: of rows that say the same the first, and the last of all."""
    rows = np.union1d(np.flatnonzero(np.r_[True, np.diff(values) != 0]), len(values) - 1)
    return Series(label, time[rows].astype(np.int64), values[rows].astype(np.float64), draw="step")


def _series(label: str, time: Figures, values: Figures) -> Series:
    figures = values if values.dtype.kind == "f" else values.astype(np.float64)
    time, (figures,) = with_gaps(time.astype(np.int64), (figures,))
    return Series(label, time, figures)


def _limit(health: Sequence[Mapping[str, Any]], row: str) -> float | None:
    found = (one["threshold"] for one in health if one["id"] == row and one["threshold"] is not None)
    return next(found, None)


def _panel(panel: str, series: Iterable[Series], axis: int = 0, limit: float | None = None) -> Iterator[Panel]:
    known = tuple(one for one in series if np.any(np.isfinite(one.values)))
    if known:
        name = panel_name(panel, axis)
        number = f"{panel}.{axis}" if axes_of(panel) > 1 else panel
        yield Panel(number, name.group, name.title, name.unit, known, limit=limit)
