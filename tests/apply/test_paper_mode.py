"""The paper's tables 11 and 12 give the paper's decision.

García, Molina, Trincado, "Real evaluation for designing sensor fusion in UAV platforms", tables 11 and 12.
"""

import math

import pytest

from fusetune.apply.paper_mode import PaperEntry, aggregate_rms, paper_ranking

TABLE_11 = {
    "EKF2_ACC_B_NOISE": (0.003, 0.001, 0.003, 0.007, 0.01, 0.003),
    "EKF2_GYR_B_NOISE": (0.001, 0.001, 0.003, 0.007, 0.01, 0.001),
    "EKF2_ACC_NOISE": (0.35, 0.1, 0.3, 0.7, 1.0, 0.35),
    "EKF2_GYR_NOISE": (0.015, 0.01, 0.03, 0.07, 0.1, 0.015),
}
TABLE_12 = {
    "pos_x": (0.1456, 0.1786, 0.2011, 0.1958, 0.1205, 0.1684),
    "pos_y": (0.1366, 0.1220, 0.1451, 0.1368, 0.1294, 0.1070),
    "pos_z": (0.1674, 0.1468, 0.1452, 0.1414, 0.1527, 0.1651),
    "vel_x": (0.3495, 0.2583, 0.2280, 0.2059, 0.2517, 0.2746),
    "vel_y": (0.3250, 0.2276, 0.2187, 0.2025, 0.2732, 0.2610),
    "vel_z": (0.2115, 0.1940, 0.2226, 0.2192, 0.2060, 0.2172),
}
AGGREGATE = (0.5210, 0.3572, 0.3387, 0.3084, 0.3586, 0.4121)


def test_the_papers_table_gives_the_papers_ranking() -> None:
    entries = [PaperEntry(f"flight {i}", value) for i, value in enumerate(AGGREGATE, start=1)]
    assert [entry.name[-1] for entry in paper_ranking(entries)] == ["4", "3", "2", "5", "6", "1"]


def test_flights_one_and_six_flew_the_same_parameters_and_differ_by_a_quarter() -> None:
    assert all(values[0] == values[5] for values in TABLE_11.values())
    assert AGGREGATE[0] / AGGREGATE[5] - 1.0 == pytest.approx(0.26, abs=0.005)


def test_our_aggregate_of_table_12_is_another_figure_but_has_the_same_worst_flight() -> None:
    ours = [aggregate_rms({name: values[i] for name, values in TABLE_12.items()}) for i in range(6)]
    # by hand for flight 4: sqrt(0.1958² + 0.1368² + 0.1414² + 0.2059² + 0.2025² + 0.2192²)
    assert ours[3] == pytest.approx(0.4566, abs=1e-4)
    assert ours.index(max(ours)) == AGGREGATE.index(max(AGGREGATE))


def test_a_consistent_set_goes_before_an_inconsistent_one_and_breaks_decide_ties() -> None:
    entries = [
        PaperEntry("small but inconsistent", 0.1, consistent=False),
        PaperEntry("many breaks", 0.3, consistent=True, break_rate=0.2),
        PaperEntry("few breaks", 0.3, consistent=True, break_rate=0.1),
        PaperEntry("unknown", math.nan, consistent=True),
    ]
    assert [e.name for e in paper_ranking(entries)] == [
        "few breaks",
        "many breaks",
        "unknown",
        "small but inconsistent",
    ]


def test_where_no_set_is_consistent_the_rms_alone_decides() -> None:
    entries = [PaperEntry("a", 0.2, consistent=False), PaperEntry("b", 0.1, consistent=False)]
    assert [entry.name for entry in paper_ranking(entries)] == ["b", "a"]


def test_aggregate_without_a_variable_is_unknown() -> None:
    assert math.isnan(aggregate_rms({"pos_x": 1.0}))
