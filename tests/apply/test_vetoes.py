"""Vetoes from events made by hand: how many, on how many flights, how large, how long."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from tests.apply.statistics.test_leave_one_out import flight as evidence

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.vetoes import break_rates, vetoes

SETTINGS = DecisionSettings()
NOTHING = METRICS_SCHEMA.empty_table()


def events(**given: Any) -> dict[str, Any]:
    """What the summary of a flight of 100 s says of a quiet set, but for what is given."""
    quiet: dict[str, Any] = {
        "reason": "", "overrides": {}, "flight_s": 100.0, "significant_resets": 0, "reset_jumps": {}, "timeouts": {},
        "fault_s": {},
    }  # fmt: skip
    return quiet | given


def flights(own: list[dict[str, Any]], base: list[dict[str, Any]] | None = None) -> list[AnalyzedFlight]:
    """Flights that hold the sets "a", the present one, and "b"."""
    made = []
    for number, (of_b, of_a) in enumerate(zip(own, base or [events()] * len(own), strict=True)):
        one = evidence(f"f{number}", [0.0, -0.2])
        made.append(AnalyzedFlight(one.flight, Path(), {"sets": {"a": of_a, "b": of_b}}, NOTHING, one))
    return made


def reasons(made: list[AnalyzedFlight], metrics: pa.Table = NOTHING) -> list[str]:
    return vetoes("b", "a", made, break_rates(metrics), SETTINGS)


def resets(*counts: int) -> list[dict[str, Any]]:
    return [events(significant_resets=count) for count in counts]


def test_the_fixture_names_its_sets() -> None:
    assert evidence("f", [0.0, -0.2]).sets == ("a", "b")


@pytest.mark.parametrize(
    ("own", "base"),
    [
        # 6 against 4, and 11 against 4, over eight flights; 2.5 % take 13 against 4
        ([1, 1, 1, 1, 1, 1, 0, 0], [1, 1, 1, 1, 0, 0, 0, 0]),
        ([4, 4, 3, 0, 0, 0, 0, 0], [2, 2, 0, 0, 0, 0, 0, 0]),
        # many, but in a row on one flight
        ([40, 0, 0, 0, 0, 0, 0, 0], [0] * 8),
        ([5, 5, 0, 0], [6, 6, 0, 0]),
    ],
)
def test_resets_that_may_be_chance_rule_nothing_out(own: list[int], base: list[int]) -> None:
    assert reasons(flights(resets(*own), resets(*base))) == []


@pytest.mark.parametrize(
    ("own", "base"), [([3, 3, 0, 0], [0] * 4), ([9, 9, 9, 9], [2, 2, 2, 2]), ([30, 0], [0, 0]), ([8], [0])]
)
def test_more_resets_beyond_doubt_rule_a_set_out(own: list[int], base: list[int]) -> None:
    found = reasons(flights(resets(*own), resets(*base)))
    if len(own) == 2:
        # All on one of two flights: one flight in a row.
        assert found == []
    else:
        assert found == [f"{sum(own)} resets that moved the state far, the present set has {sum(base)}"]


def test_the_reason_tells_the_largest_jump() -> None:
    jumps = {"horizontal_position": {"largest": 3.21, "rms": 2.0, "unit": "m"}}
    far = jumps | {
        "height": {"largest": 4.0, "rms": 4.0, "unit": "m"},
        "heading": {"largest": 31.0, "rms": 31.0, "unit": "deg"},
    }
    own = [events(significant_resets=4, reset_jumps=one) for one in (jumps, far)]
    assert reasons(flights(own)) == ["8 resets that moved the state far (by up to 4 m, 31 deg), the present set has 0"]


def test_lost_sources_are_counts_as_well() -> None:
    lost = [events(timeouts={"gnss_pos": 2, "mag": 1}) for _ in range(3)]
    assert reasons(flights(lost)) == ["9 lost aid sources, the present set has 0"]
    assert reasons(flights(lost[:1] + [events()] * 4)) == []


def test_a_passing_fault_on_one_flight_rules_nothing_out() -> None:
    once = [events(fault_s={"fs_bad_hdg": 0.4}), *[events()] * 4]
    assert reasons(flights(once)) == []


def test_a_covariance_that_fails_again_or_for_long_rules_a_set_out() -> None:
    again = [events(fault_s={"fs_bad_hdg": 0.4}), events(), events(fault_s={"fs_bad_hdg": 0.2})]
    assert reasons(flights(again)) == ["filter fault fs_bad_hdg on f0, f2 (0.6 s)"]
    # 1.2 % of the flight
    lasting = [events(fault_s={"fs_bad_mag_x": 1.2}), *[events()] * 4]
    assert reasons(flights(lasting)) == ["filter fault fs_bad_mag_x on f0 (1.2 s)"]
    alike = [events(fault_s={"fs_bad_mag_x": 1.0})] * 5
    assert reasons(flights(alike, alike)) == []


def test_a_condition_of_the_flight_counts_where_it_lasts_longer_and_on_more_than_one_flight() -> None:
    name = "fs_bad_acc_vertical"
    base = [events(fault_s={name: 3.0}), events(), events()]
    assert reasons(flights([events(fault_s={name: 3.5}), events(), events()], base)) == []
    assert reasons(flights([events(fault_s={name: 9.0}), events(), events()], base)) == []
    both = [events(fault_s={name: 9.0}), events(fault_s={name: 4.0}), events()]
    assert reasons(flights(both, base)) == [f"filter fault {name} on f0, f1 (13 s)"]


def test_clipping_is_the_same_for_all_sets() -> None:
    assert reasons(flights([events(fault_s={"fs_bad_acc_clipping": 50.0})] * 3)) == []


def breaks(rates: dict[str, list[float]], samples: int, axes: str = "xyz") -> pa.Table:
    """Break rates of GNSS velocity on each flight by set; on all axes but the first those of the present set."""
    rows = [
        {
            "flight": f"f{number}", "set": name, "source": "gnss_vel", "axis": axis, "metric": "break_rate_gate",
            "value": rate if axis == axes[0] else rates["a"][number], "lower": np.nan, "upper": np.nan, "n": samples,
        }
        for name, of_set in rates.items()
        for number, rate in enumerate(of_set)
        for axis in axes
    ]  # fmt: skip
    return pa.Table.from_pylist(rows, schema=METRICS_SCHEMA)


def test_break_rates_allow_for_the_number_of_comparisons() -> None:
    """9 of 200 against 0 of 200: the 95 % bounds part, 0.0208 above 0.0183, those at 1 − 0.05/6 do not, 0.0154 and
    0.0270. Compared are two flights with three axes each. 20 of 200 are more at that level, too: 0.0521."""
    made = flights([events()] * 2)
    assert reasons(made, breaks({"a": [0.0, 0.0], "b": [0.045, 0.045]}, 200)) == []
    assert len(reasons(made[:1], breaks({"a": [0.0], "b": [0.045]}, 200, axes="x"))) == 1
    found = reasons(made, breaks({"a": [0.0, 0.0], "b": [0.1, 0.1]}, 200))
    assert found == ["on 2 of 2 flights 10.0 % of gnss_vel x beyond the gate, the present set has 0.0 % there"]


def test_breaks_on_one_of_several_flights_rule_nothing_out() -> None:
    made = flights([events()] * 4)
    assert reasons(made, breaks({"a": [0.0] * 4, "b": [0.3, 0.0, 0.0, 0.0]}, 300)) == []
    assert reasons(made[:1], breaks({"a": [0.0], "b": [0.3]}, 300)) != []


def test_a_set_without_a_score_is_told_what_it_lacks() -> None:
    lacks = {"gnss_vel": "lacks 200 of 300 samples of gnss_vel that the present set has, more than 20 %", "mag": "so"}
    one = evidence("f0", [0.0])
    summary = {"sets": {"a": events(), "b": events(evidence={"left_out": lacks})}}
    made = [AnalyzedFlight("f0", Path(), summary, NOTHING, one)]
    assert reasons(made) == [f"f0: {lacks['gnss_vel']}"]
