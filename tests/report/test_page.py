"""The report of a made study: complete, self-contained, of the same bytes every time."""

import re
import shutil
from pathlib import Path

from PIL import Image
from tests.analyze.made_flight import MadeSet
from tests.report.made_report import SETS, make_report

from fusetune.report.figures.flight_figures import plot_flight
from fusetune.report.figures.summary_figures import SUMMARY_FIGURES, plot_summary


def test_the_page_needs_no_network(made: tuple[Path, str]) -> None:
    _, page = made
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', page)
    assert len(sources) == len(SUMMARY_FIGURES) + 5
    assert all(source.startswith("data:image/") for source in sources)
    outside_figures = re.sub(r'src="data:[^"]*"', "", page)
    assert "http" not in outside_figures
    assert "@import" not in page
    assert "url(" not in page


def test_the_page_says_what_was_decided_and_why(made: tuple[Path, str]) -> None:
    _, page = made
    assert "Change to “better”" in page
    assert "better on 5 of 5 flights" in page
    assert "EKF2_ACC_NOISE" in page
    assert "10 resets that moved the state far (by up to 3 m), the present set has 0" in page
    assert "IMU at 20 Hz" in page
    assert "ab" * 32 in page
    for heading in (
        "What to do next",
        "What the flights say",
        "What PX4 is told, and what the data say",
        "Without a sensor",
        "Does the choice hold?",
        "What counts how much",
        "The flights",
        "The parameter sets",
        "The innovations",
        "True errors",
        "Paper mode",
        "Flight by flight",
    ):
        assert f"<h2>{heading}" in page


def test_names_are_escaped(made: tuple[Path, str]) -> None:
    _, page = made
    assert "<restless>" not in page
    assert "&lt;restless&gt;" in page


def test_all_figures_are_there_and_the_pictures_are_readable_images(made: tuple[Path, str]) -> None:
    root, _ = made
    assert all(
        (root / "report" / name).read_text(encoding="utf-8").lstrip().startswith("<?xml") for name in SUMMARY_FIGURES
    )
    with Image.open(root / "report" / "flights" / "flight_0.png") as image:
        assert image.size == (1000, 680)
        assert len(image.convert("RGB").getcolors(100_000) or []) > 10


def test_figures_are_the_same_bytes_twice(made: tuple[Path, str], tmp_path: Path) -> None:
    root, _ = made
    folders = [root / "analyze" / f"flight_{i}" for i in range(5)]
    plot_summary(folders, root / "apply", tmp_path)
    for name in SUMMARY_FIGURES:
        assert (tmp_path / name).read_bytes() == (root / "report" / name).read_bytes(), name


def test_the_picture_of_a_flight_is_the_same_where_other_sets_replays_are_gone(
    made: tuple[Path, str], tmp_path: Path
) -> None:
    root, _ = made
    others = [f"{name}.*" for name in SETS if name != "present"]
    shutil.copytree(root / "analyze" / "flight_0", tmp_path / "kept", ignore=shutil.ignore_patterns(*others))
    assert not list((tmp_path / "kept").glob("better.*"))
    plot_flight(root / "save" / "flight_0", tmp_path / "kept", list(SETS), tmp_path / "flight.png")
    assert (tmp_path / "flight.png").read_bytes() == (root / "report" / "flights" / "flight_0.png").read_bytes()


def test_no_flights_still_make_a_page(tmp_path: Path) -> None:
    page = make_report(tmp_path, {"present": MadeSet(), "b": MadeSet()}, flights=0)
    assert "no flight could be replayed" in page


def test_flights_that_cannot_be_scored_still_make_a_page(tmp_path: Path) -> None:
    page = make_report(tmp_path, {"present": MadeSet(), "b": MadeSet()}, flights=1, landing_s=12.0)
    assert "s of flight remain after the warm-up" in page


def test_of_one_block_the_page_says_what_is_not_known(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.1), "worse": MadeSet(error=0.2), "better": MadeSet(error=0.05)}
    page = without_pictures(make_report(tmp_path, sets, flights=1, landing_s=21.0))
    assert "how far chance could do that is not known" in page
    ranking = page[page.index("Ranking, best first") : page.index("All other criteria")]
    for name in ("worse", "better"):
        (row,) = (part for part in ranking.split("<tr>") if f">{name}<" in part)
        assert row.partition("</tr>")[0].count("not known") == 4
        assert ">eligible<" in row
    assert "beyond doubt" not in page[: page.index("Without a sensor")]
    assert not re.search(r">[^<]*\bnan\b", page)
    assert ">None<" not in page


def test_flights_that_are_all_distrusted_have_no_say_and_no_green_mark(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13), "better": MadeSet(error=0.1)}
    reason = "the replay resets its height 144 times where the vehicle did so 0 times"
    fidelity = {"grade": "D", "trust": {"is_compared": True, "reason": reason}}
    page = without_pictures(make_report(tmp_path, sets, flights=2, fidelity=fidelity))
    assert "none of the 2 replayed flights has a say" in page
    assert "could not be scored" not in page
    assert reason in page
    assert ", from no flight</p>" in page
    assert "3 logs, 2 scored, 0 in the decision." in page
    flights = page[page.index("Flight by flight") :]
    assert '<span class="good">' not in flights
    assert flights.count('<span class="bad">') == 2
    assert "flight_0 – not counted: its replay has trust grade D" in flights


def without_pictures(page: str) -> str:
    return re.sub(r'src="data:[^"]*"', "", page)


def test_all_sets_ruled_out_are_told_as_such(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.1), "a": MadeSet(resets_s=(40.0, 50.0)), "b": MadeSet(fault_flags=8)}
    page = without_pictures(make_report(tmp_path, sets, flights=3))
    assert "No other set was eligible for comparison." in page
    assert "Ruled out, and so not eligible: " in page
    ranking = page[page.index("Ranking, best first") : page.index("All other criteria")]
    assert ranking.count(">not eligible<") == 2


def test_a_set_that_diverged_is_drawn_around(tmp_path: Path) -> None:
    page = make_report(tmp_path, {"present": MadeSet(), "b": MadeSet(status="diverged")}, flights=1)
    assert "diverged: the covariance is not finite" in page


def test_a_present_set_that_diverged_leaves_the_flight_unscored(tmp_path: Path) -> None:
    page = make_report(tmp_path, {"present": MadeSet(status="diverged"), "b": MadeSet()}, flights=1)
    assert "the present set: diverged: the covariance is not finite" in page
