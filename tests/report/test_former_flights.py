"""What is left of flights whose logs were taken away."""

from __future__ import annotations

from pathlib import Path

from fusetune.report.former_flights import remove_former_flights


def test_of_flights_that_are_gone_nothing_stays(tmp_path: Path) -> None:
    for name in ("one.html", "one.png", "gone.html", "gone.png", "one.v2.html", ".gone.partial.html"):
        (tmp_path / name).write_text("page")
    (tmp_path / "folder").mkdir()
    assert remove_former_flights(tmp_path, {"one", "one.v2"}) == ["gone.html", "gone.png"]
    assert {one.name for one in tmp_path.iterdir()} == {
        "one.html",
        "one.png",
        "one.v2.html",
        ".gone.partial.html",
        "folder",
    }
    assert remove_former_flights(tmp_path / "nowhere", {"one"}) == []
