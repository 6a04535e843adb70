"""Of more sets than a flight's page shows, the chosen one is shown: so the page waits for the decision."""

from __future__ import annotations

from tests.workflow.conftest import STUDY, Workspace


def test_the_page_of_a_flight_waits_for_the_decision_where_it_cannot_show_all_sets(flown: Workspace) -> None:
    page = "results/report/flights/first.html"
    assert "decide" not in flown.planned_jobs(page)
    values = [round(0.2 + 0.01 * number, 2) for number in range(25)]
    many = [{"name": f"noise_{round(100 * value)}", "parameters": {"EKF2_ACC_NOISE": value}} for value in values]
    flown.write("small.yaml", STUDY | {"sets": many})
    assert "decide" in flown.planned_jobs(page)
