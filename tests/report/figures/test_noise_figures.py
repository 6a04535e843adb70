"""What is drawn of the sensors of a flight."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from tests.analyze.sensor_noise.made_sensors import (
    AIRBORNE,
    LANDING_S,
    MAG,
    START_US,
    TAKE_OFF_S,
    made_flight,
    made_topics,
)

from fusetune.analyze.sensor_noise.pooled import pooled_sensors
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise, sensor_noise
from fusetune.report.figures.allan_figure import draw_allan, draw_pooled_allan
from fusetune.report.figures.noise_figures import plot_pooled_sensors, plot_sensor_noise
from fusetune.report.figures.sensor_figures import draw_pooled_sensor, draw_sensor
from fusetune.report.figures.spectrum_figure import draw_spectra

WRONG_S = 40.0


@pytest.fixture(scope="module")
def noise() -> SensorNoise:
    topics = made_topics(np.random.default_rng(1))
    mag = topics["vehicle_magnetometer", 0]
    mag["magnetometer_ga[1]"][round(WRONG_S * 50)] += 30 * MAG
    return sensor_noise(made_flight(topics), AIRBORNE)


def texts(axes: Axes) -> str:
    return "\n".join(one.get_text() for one in axes.texts)


def title(axes: Axes) -> str:
    """Where the report's style puts it, or matplotlib's own."""
    return axes.get_title(loc="left") or axes.get_title()


def test_outliers_are_marked_where_they_are(noise: SensorNoise) -> None:
    figure = draw_sensor(noise, "mag")
    panel = next(axes for axes in figure.axes if axes.get_ylabel().startswith("y "))
    (marked,) = (line for line in panel.lines if line.get_marker() == "x")
    assert marked.get_xdata() == pytest.approx([WRONG_S])
    assert "1 outlier (×)" in texts(panel)
    still = next(axes for axes in figure.axes if axes.get_ylabel().startswith("x "))
    assert "outliers" not in texts(still)


def test_flight_and_rest_are_shaded(noise: SensorNoise) -> None:
    panel = draw_sensor(noise, "baro").axes[0]
    edges = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in panel.patches]
    assert edges[-1] == pytest.approx((TAKE_OFF_S, LANDING_S))
    still = [(t - START_US) * 1e-6 for one in noise.still for t in one]
    assert [edge for one in edges[:-1] for edge in one] == pytest.approx(still)


def test_boxes_are_the_quartiles(noise: SensorNoise) -> None:
    boxes = next(axes for axes in draw_sensor(noise, "gyro").axes if title(axes).startswith("Spread"))
    assert len(boxes.patches) == 6
    widths = sorted(np.ptp(patch.get_path().vertices[:, 0]) for patch in boxes.patches)
    quartiles = sorted(
        one.quantiles[4] - one.quantiles[2]
        for part in (noise.sensors["gyro"].at_rest, noise.sensors["gyro"].in_flight)
        for one in part
    )
    assert widths == pytest.approx(quartiles)


def test_histogram_is_a_density(noise: SensorNoise) -> None:
    histogram = next(axes for axes in draw_sensor(noise, "accel").axes if title(axes) == "Histogram")
    for patch in histogram.patches:
        values, edges, _ = patch.get_data()
        assert np.sum(values * np.diff(edges)) == pytest.approx(1.0)


def test_allan_says_the_figures_and_what_is_not_told(noise: SensorNoise) -> None:
    figure = draw_allan(noise)
    assert len(figure.axes) == len(noise.sensors)
    figures = noise.sensors["gyro"].figures
    assert f"N = {figures.noise_density.value:.3g}" in texts(figure.axes[0])
    assert "K not told, at most" in texts(figure.axes[0])


def test_a_log_without_standing_still_says_what_to_do() -> None:
    topics = made_topics(np.random.default_rng(2))
    topics["vehicle_status", 0]["arming_state"] = np.full(3, 2, np.uint8)
    figure = draw_allan(sensor_noise(made_flight(topics), AIRBORNE))
    assert "SDLOG_MODE" in texts(figure.axes[0])


def test_spectra_say_what_vibration_limits(noise: SensorNoise) -> None:
    titles = [title(axes).replace("\n", " ") for axes in draw_spectra(noise).axes]
    assert re.search(r"[45]\.\d × in flight, vibration-limited", titles[0])
    assert "vibration-limited" not in titles[2]


def test_a_box_for_each_flight(noise: SensorNoise) -> None:
    other = sensor_noise(made_flight(made_topics(np.random.default_rng(3)), "other"), AIRBORNE)
    pooled = pooled_sensors([noise.document(), other.document()])
    figure = draw_pooled_sensor(pooled[0])
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["made", "other"]
    assert len(figure.axes[0].patches) == 4
    assert len(draw_pooled_allan(pooled).axes) == len(pooled)


def test_files(noise: SensorNoise, tmp_path: Path) -> None:
    few = replace(noise, sensors={name: noise.sensors[name] for name in ("baro",)})
    files = plot_sensor_noise(few, tmp_path / "flight")
    names = {"sensor_baro.png", "allan.svg", "spectra.svg"}
    assert {file.name for file in files} == names
    pooled = plot_pooled_sensors(pooled_sensors([few.document()]), tmp_path / "vehicle")
    assert "pooled_baro_0.svg" in {file.name for file in pooled}
    assert all(file.stat().st_size > 1000 for file in (*files, *pooled))
    once = {file: file.read_bytes() for file in files}
    plot_sensor_noise(few, tmp_path / "flight")
    assert once == {file: file.read_bytes() for file in files}
