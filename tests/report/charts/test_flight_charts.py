"""Charts of one flight and of all flights: sensors, findings in time, the track, figures of health."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.conformance import SHAPES, mission_of
from tests.analyze.conformance.made_track import flown_in_order, track_of
from tests.analyze.sensor_noise.made_sensors import AIRBORNE, made_flight, made_topics
from tests.apply.fleet.made_fleet import date, row, write_health_rows
from tests.report.charts.test_charts import SVG, charts_of
from tests.report.made_health import SHAKEN, write_documents

from fusetune.analyze.conformance.conformance_files import conformance_document, rounded_figures
from fusetune.analyze.sensor_noise.pooled import pooled_sensors
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise, sensor_noise
from fusetune.apply.fleet.fleet import write_fleet
from fusetune.px4.flight import Flight
from fusetune.report.charts.conformance import conformance_chart
from fusetune.report.charts.fleet import other_histograms_chart, trends_chart, troubled_histograms_chart
from fusetune.report.charts.sensors import (
    allan_chart,
    pooled_allan_chart,
    pooled_sensor_chart,
    sensor_chart,
    spectra_chart,
)
from fusetune.report.charts.timeline import timeline_chart
from fusetune.report.fleet.fleet_results import FleetResults, read_fleet_results
from fusetune.report.flight_results import read_flight_results

EPH = (1.4, 1.1, 1.6, 1.2, 1.5, 1.0, 1.7, 1.3)
"""Without a drift; the median is 1.35."""


@pytest.fixture(scope="module")
def noise() -> SensorNoise:
    topics = made_topics(np.random.default_rng(1))
    topics["vehicle_magnetometer", 0]["magnetometer_ga[1]"][2000] += 1.0
    return sensor_noise(made_flight(topics), AIRBORNE)


def test_sensors_of_a_flight(noise: SensorNoise) -> None:
    for name in noise.sensors:
        axes = len(noise.sensors[name].sensor.axes)
        # a sequence for each axis, boxes, histogram, normality
        assert len(charts_of(sensor_chart(noise, name))) == axes + 3
    second = charts_of(sensor_chart(noise, "mag"))[1]
    assert str(second.findtext(f"{SVG}desc")).endswith("1 outlier")
    assert len(charts_of(allan_chart(noise))) == sum(bool(len(one.curve.factors)) for one in noise.sensors.values())
    assert charts_of(spectra_chart(noise))
    pooled = pooled_sensors([noise.document()])
    assert charts_of(pooled_allan_chart(pooled))
    # boxes, and the histogram of all
    assert len(charts_of(pooled_sensor_chart(pooled[0]))) == 2


def test_findings_lie_in_time(tmp_path: Path) -> None:
    """From 20 to 32.5 s of 50 on an axis from 2 to 310 px, in the narrow form: 125.2 to 202.2."""
    results = read_flight_results(write_documents(tmp_path / "<flight>", [SHAKEN]))
    narrow, wide = charts_of(timeline_chart(results))
    assert str(wide.get("viewBox")).startswith("0 0 720 ")
    (bar,) = (one for one in narrow.iter(f"{SVG}rect") if one.get("class") == "fill" and one.get("height") == "12")
    assert (bar.get("x"), bar.get("width")) == ("125.2", "77")
    assert timeline_chart(read_flight_results(write_documents(tmp_path / "sound", []))) == ""


def test_the_track_over_the_mission() -> None:
    asked = mission_of("box", SHAPES["box"]())
    track = track_of(flown_in_order(asked, [0, 1, 3, 4, 5, 6, 7]))
    document: Any = rounded_figures(conformance_document(Flight("boxed"), track, [asked]))
    seen, over_time = charts_of(conformance_chart(track, document))
    hints = [one.text for one in seen.iter(f"{SVG}title")]
    assert "waypoint 3: missed" in hints
    assert hints.count("waypoint 1: passed") == 1
    assert over_time.findtext(f"{SVG}title") == "Height above take-off"
    assert conformance_chart(None, document) == ""


@pytest.fixture
def fleet(tmp_path: Path) -> FleetResults:
    rows = []
    for place in range(8):
        told = {"date": date(place)}
        rate = 40.0 if place == 3 else 200.0 + place
        severity = "fail" if place == 3 else "pass"
        rows += [
            row(f"<flight {place}>", "gnss.eph", EPH[place], threshold=3.0, **told),
            row(f"<flight {place}>", "imu.rate_hz", rate, unit="Hz", group="sensor", threshold=100.0,
                severity=severity, **told),
        ]  # fmt: skip
    health = write_health_rows(tmp_path / "health.parquet", rows)
    write_fleet(health, [], tmp_path / "fleet.json")
    return read_fleet_results(tmp_path / "fleet.json", health, {})


def test_all_flights_in_time_and_as_histograms(fleet: FleetResults) -> None:
    (trend,) = charts_of(trends_chart(fleet))
    assert trend.findtext(f"{SVG}title") == "IMU: samples a second"
    rings = [one for one in trend.iter(f"{SVG}circle") if str(one.get("class")).startswith("ring")]
    # the flight that fails, and the two of the legend
    assert len(rings) == 3
    assert any(one.text == "<flight 3>: 40 Hz, fail" for one in trend.iter(f"{SVG}title"))
    (troubled,), (other,) = charts_of(troubled_histograms_chart(fleet)), charts_of(other_histograms_chart(fleet))
    assert str(troubled.findtext(f"{SVG}title")).startswith("IMU: samples a second")
    assert str(other.findtext(f"{SVG}desc")).startswith("8 flights: median 1.35")
