"""`fusetune plot`: the files that it writes, and what it says of what it cannot draw."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure
from tests.report.made_health import logged_flight

from fusetune.cli import main
from fusetune.errors import UserError
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.writer import write_ulog
from fusetune.report.figures.asked_figures import write_figures
from fusetune.report.figures.drawing import new_figure
from fusetune.report.figures.paper_figures import PAPER_FIGURES

Captured = pytest.CaptureFixture[str]


def test_a_log_is_replayed_and_drawn_in_the_width_of_a_column(
    survey_flight: Flight, tmp_path: Path, capsys: Captured
) -> None:
    log = tmp_path / "survey.ulg"
    write_ulog(log, survey_flight)
    asked = ["--set", "EKF2_GPS_DELAY=160", "--figure", "innovations_gnss_vel", "--figure", "13", "--size", "single"]
    assert main(["plot", str(log), *asked, "--out", str(tmp_path / "one")]) == 0
    files = [tmp_path / "one" / f"{name}.svg" for name in ("innovations_gnss_vel", "attitude")]
    assert capsys.readouterr().out.splitlines() == [str(one) for one in files]
    for file in files:
        drawn = ElementTree.parse(file).getroot()
        # 85 mm in points
        assert float(str(drawn.get("width")).removesuffix("pt")) == pytest.approx(85.0 / 25.4 * 72.0, abs=0.01)


def _drawings() -> dict[str, Callable[[], Figure]]:
    def one() -> Figure:
        figure = new_figure(1.0, 1.0)
        figure.add_subplot().plot([0.0, 1.0])
        return figure

    return {"biases": one, "biases_2": one, "sensor_gyro": one, "test_ratios": one}


def test_all_figures_are_pages_of_one_pdf_and_the_same_bytes(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (file,) = write_figures(_drawings(), [], "pdf", tmp_path / folder, "flight")
    assert file.name == "flight.pdf"
    # sensors are drawn when they are asked for
    assert len(re.findall(rb"/Type /Page\b", file.read_bytes())) == 3
    assert (tmp_path / "a" / "flight.pdf").read_bytes() == (tmp_path / "b" / "flight.pdf").read_bytes()


def test_figures_are_asked_for_by_name_and_by_number(tmp_path: Path) -> None:
    files = write_figures(_drawings(), ["biases", "5", "20"], "png", tmp_path, "flight")
    assert [one.name for one in files] == ["biases.png", "biases_2.png", "sensor_gyro.png", "test_ratios.png"]
    assert all(one.read_bytes().startswith(b"\x89PNG") for one in files)
    assert list(PAPER_FIGURES) == list(range(5, 21))
    with pytest.raises(UserError, match="figures are 5 to 20"):
        write_figures(_drawings(), ["21"], "png", tmp_path)
    with pytest.raises(UserError, match=r"there is none of wind here\. There is: biases, biases_2"):
        write_figures(_drawings(), ["wind"], "png", tmp_path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "EKF2_GPS_DELAYS=1"], "--set: EKF2_GPS_DELAYS: unknown EKF2 parameter"),
        (["--set", "EKF2_GPS_DELAY=160"], "cannot be replayed"),
        (["--flight", "a"], "is a log, which is one flight"),
    ],
)
def test_what_cannot_be_drawn_is_told(tmp_path: Path, capsys: Captured, arguments: list[str], words: str) -> None:
    """The log holds no IMU."""
    log = tmp_path / "still.ulg"
    write_ulog(log, logged_flight())
    assert main(["plot", str(log), *arguments, "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_without_results_is_told(tmp_path: Path, capsys: Captured) -> None:
    assert main(["plot", str(tmp_path)]) == 2
    assert "holds no apply/decision.json. Name the folder results of a run, or a log" in capsys.readouterr().err
