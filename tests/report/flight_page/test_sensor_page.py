"""Pages of sensors: of a flight, and of all flights."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.report.read_page import check_page

from fusetune.analyze.sensor_noise.sensor_noise import write_sensor_noise
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.writer import write_ulog
from fusetune.report.flight_page.sensor_page import build_pooled_sensor_page, build_sensor_page
from fusetune.save.log_folder import save_log
from fusetune.storage.documents import read_document, write_document


@pytest.fixture(scope="module")
def flight(survey_flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sensors")
    log = folder / "survey.ulg"
    write_ulog(log, survey_flight)
    save_log(log, folder / "save" / "survey")
    write_sensor_noise(folder / "save" / "survey", folder / "analyze")
    told = read_document(folder / "analyze" / "sensor_noise.json")
    told["sensors"] = {name: told["sensors"][name] for name in ("gyro", "baro")}
    for vehicle in ("one", "other"):
        (folder / vehicle).mkdir()
        write_document(folder / vehicle / "sensor_noise.json", told | {"flight": f"flight of {vehicle}"})
        write_document(folder / vehicle / "health.json", {"vehicle": vehicle})
    return folder


def drawn(page: str) -> list[str]:
    """Titles of the parts that hold a picture."""
    return [one[0] for one in re.findall(r"<summary>([^<]*)</summary>(?=(.{0,400}?)<svg)", page, flags=re.S)]


def test_the_page_of_a_flight_has_a_picture_of_each_sensor(flight: Path, tmp_path: Path) -> None:
    build_sensor_page(flight / "save" / "survey", flight / "analyze", tmp_path / "page.html")
    page = check_page((tmp_path / "page.html").read_text(encoding="utf-8")).source
    # gyro, accelerometer, magnetometer, barometer, GNSS velocity and position; Allan deviation and spectra
    assert [one.partition(":")[0] for one in drawn(page)] == [
        "Allan deviation", "Spectra", "gyro", "accel", "mag", "baro", "gnss_vel", "gnss_pos",
    ]  # fmt: skip
    assert "snakemake --cores 2 sensors" not in page


def test_the_page_of_all_flights_has_a_picture_of_each_device(flight: Path, tmp_path: Path) -> None:
    build_pooled_sensor_page([flight / "one"] * 2, tmp_path / "page.html")
    page = check_page((tmp_path / "page.html").read_text(encoding="utf-8")).source
    assert [one.rpartition(", ")[2] for one in drawn(page)] == ["2 flights", "2 flights", "Allan deviation"]


def test_vehicles_whose_devices_have_the_same_ids_are_not_taken_for_one(flight: Path, tmp_path: Path) -> None:
    build_pooled_sensor_page([flight / "one", flight / "other"], tmp_path / "page.html")
    page = check_page((tmp_path / "page.html").read_text(encoding="utf-8")).source
    assert [one.rpartition(", ")[2] for one in drawn(page)] == ["1 flight", "1 flight", "Allan deviation"] * 2
    assert re.findall("<h2>(.*?)</h2>", page) == ["one", "other"]


def test_without_any_sensor_the_pages_say_so(tmp_path: Path) -> None:
    build_pooled_sensor_page([], tmp_path / "page.html")
    assert "No log" in (tmp_path / "page.html").read_text(encoding="utf-8")
