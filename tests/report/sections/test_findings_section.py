"""What the page says of vehicle and sensors."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from fusetune.finding import Finding, documents
from fusetune.report.sections.findings_section import findings_section

NOISE: dict[str, Any] = {
    "source": "gnss_vel", "flights": 7, "told": 0.3, "size": 0.1, "lower": 0.08, "upper": 0.12, "innovation": 0.1,
    "wanted": 0.21, "wanders_s": 2.0, "is_bound": False, "parameter": "EKF2_GPS_V_NOISE", "now": 0.3, "rules": True,
}  # fmt: skip


def results(**decision: Any) -> Any:
    return SimpleNamespace(decision=decision)


def test_findings_are_told_with_what_to_do() -> None:
    finding = Finding("told_noise_gnss_vel", "note", "PX4 is told <too much>", "Compare another")
    page = findings_section(results(findings=documents([finding]), noises=[NOISE]))
    assert "PX4 is told &lt;too much&gt;" in page
    assert "Compare another" in page
    assert "no advice to fly" in page
    assert ">0.08 to 0.12</td>" in page


def test_of_a_bound_no_size_is_shown() -> None:
    page = findings_section(results(findings=[], noises=[NOISE | {"is_bound": True}]))
    assert "at most 0.12" in page
    assert "0.08" not in page
    assert page.count("not known") == 2
    assert "what to do" not in page


def test_what_is_wrong_with_the_vehicle_stands_in_its_health_alone() -> None:
    finding = Finding("diagnosis.vibration", "fail", "The frame shakes", "Mend it")
    assert findings_section(results(findings=documents([finding]), noises=[])) == ""


def test_where_nothing_is_known_there_is_no_section() -> None:
    assert findings_section(results(findings=[], noises=[])) == ""
