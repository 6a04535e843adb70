"""Where gaps lie, and the averages that are kept of what was predicted in them; expectations by hand."""

from itertools import pairwise

import numpy as np
import pytest

from fusetune.analyze.replaying.settings import WithholdingSettings
from fusetune.analyze.replaying.store.columns import gap_table, prediction_table
from fusetune.analyze.replaying.withheld_gaps import plan_gaps
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.recording import INNOVATION_ROW, LOCAL_POSITION_ROW
from fusetune.ekf2.replay.results import Gap, GapResult
from fusetune.px4.flight import Flight

SECOND = 1_000_000


def flight(*topics: str) -> Flight:
    return Flight("made", topics={(name, 0): {"timestamp": np.arange(3)} for name in topics})


def result(innovation: np.ndarray, variance: float = 0.25, start: int = 10 * SECOND) -> GapResult:
    """A gap of 9 s with GNSS velocity north at 5 Hz, whose horizon is 0.2 s behind the IMU."""
    rows = np.zeros(innovation.size, INNOVATION_ROW)
    rows["source"], rows["axis"] = AID_SOURCE_NAMES.index("gnss_vel"), 0
    rows["timestamp_sample"] = start - 200_000 + (np.arange(innovation.size) + 1) * 200_000
    rows["innovation"], rows["innovation_variance"] = innovation, variance
    places = np.zeros(2, LOCAL_POSITION_ROW)
    places["timestamp"], places["x"], places["vy"] = (start, start + 9 * SECOND), (1.0, 4.0), (0.5, -0.5)
    return GapResult(Gap("gnss", start, start + 9 * SECOND), start - 200_000, rows, places)


def test_gaps_are_staggered_over_the_flight_time_of_each_sensor() -> None:
    settings = WithholdingSettings(
        gnss_s=9.0, gnss_every_s=4.5, gnss_fewest=0, baro_s=10.0, baro_every_s=20.0, mag_s=0.0
    )
    airborne = [(0, 20 * SECOND), (100 * SECOND, 105 * SECOND)]
    gaps = plan_gaps(flight("vehicle_gps_position", "vehicle_air_data", "vehicle_magnetometer"), airborne, settings)
    # 20 s hold gaps of 9 s that begin at 0, 4.5 and 9 s, and one of 10 s; 5 s hold none.
    assert [(gap.sensor, gap.start, gap.stop) for gap in gaps] == [
        ("gnss", 0, 9 * SECOND),
        ("gnss", 4_500_000, 13_500_000),
        ("gnss", 9 * SECOND, 18 * SECOND),
        ("baro", 0, 10 * SECOND),
    ]


@pytest.mark.parametrize(
    ("airborne_s", "lengths"),
    [
        # Four gaps every half gap take 2.5 of their length after 6 s of lead-in: 22.5, 15 and 7.5 s.
        ([(0.0, 28.5)], [9.0] * 5),
        ([(0.0, 28.4)], [6.0] * 8),
        ([(0.0, 21.0)], [6.0] * 6),
        ([(0.0, 20.9)], [3.0] * 12),
        # Nothing fits four times: the shortest, all the same.
        ([(0.0, 8.0)], [3.0] * 4),
        ([(0.0, 2.0)], []),
        # Two short hops together hold enough: two gaps of 9 s in each of 13.5 s after the lead-in.
        ([(0.0, 19.5), (100.0, 119.5)], [9.0] * 6),
    ],
)
def test_short_flights_have_shorter_gaps_without_gnss(
    airborne_s: list[tuple[float, float]], lengths: list[float]
) -> None:
    airborne = [(round(start * 1e6), round(stop * 1e6)) for start, stop in airborne_s]
    sensors = flight("vehicle_gps_position", "vehicle_air_data")
    gaps = plan_gaps(sensors, airborne, WithholdingSettings())
    gnss = [gap for gap in gaps if gap.sensor == "gnss"]
    assert [(gap.stop - gap.start) * 1e-6 for gap in gnss] == pytest.approx(lengths)
    assert all(any(start <= gap.start and gap.stop <= stop for start, stop in airborne) for gap in gaps)
    steps = {round((b.start - a.start) * 1e-6, 6) for a, b in pairwise(gnss) if b.start - a.start < 50 * SECOND}
    assert steps <= {round(length / 2, 6) for length in lengths}
    # Those of the other sensors, which no set is chosen by, keep their length.
    assert {gap.stop - gap.start for gap in gaps if gap.sensor == "baro"} <= {9 * SECOND}


def test_horizons_of_a_shorter_gap_are_thirds_of_it() -> None:
    seconds = (np.arange(15) + 1) * 0.2
    gap = result(seconds)
    short = GapResult(
        Gap("gnss", gap.gap.start, gap.gap.start + 3 * SECOND), gap.start, gap.innovations, gap.local_position
    )
    table = prediction_table([short]).to_pydict()
    assert table["horizon_s"] == pytest.approx([1.0, 2.0, 3.0])
    # Samples at 0.2 … 1.0 s, and so on: their means.
    assert table["innovation"] == pytest.approx([0.6, 1.6, 2.6], abs=1e-6)


def test_a_sensor_that_the_log_lacks_is_not_withheld() -> None:
    gaps = plan_gaps(flight("vehicle_air_data"), [(0, 60 * SECOND)], WithholdingSettings())
    assert {gap.sensor for gap in gaps} == {"baro"}


def test_innovations_of_the_last_second_before_each_horizon_are_averaged() -> None:
    seconds = (np.arange(45) + 1) * 0.2
    table = prediction_table([result(seconds)]).to_pydict()
    assert table["horizon_s"] == pytest.approx([3.0, 6.0, 9.0])
    # Samples at 2.2, 2.4 … 3.0 s, and the innovation is the time: their mean is 2.6.
    assert table["innovation"] == pytest.approx([2.6, 5.6, 8.6], abs=1e-6)
    assert table["innovation_variance"] == pytest.approx([0.25] * 3)
    assert (table["n"], table["sensor"], table["source"]) == ([5] * 3, ["gnss"] * 3, ["gnss_vel"] * 3)


def test_rows_tell_gaps_apart() -> None:
    table = prediction_table([result(np.ones(45)), result(np.full(45, 2.0), start=20 * SECOND)]).to_pydict()
    assert table["gap"] == [0, 0, 0, 1, 1, 1]
    assert table["innovation"] == pytest.approx([1.0] * 3 + [2.0] * 3)


def test_no_gaps_make_empty_tables_with_all_columns() -> None:
    assert prediction_table([]).num_rows == 0
    assert prediction_table([]).column_names == prediction_table([result(np.ones(45))]).column_names
    assert gap_table([]).num_rows == 0


def test_places_at_both_ends_are_kept() -> None:
    table = gap_table([result(np.ones(45))]).to_pydict()
    assert (table["x_begin"], table["x_end"], table["vy_end"]) == ([1.0], [4.0], [-0.5])
    assert table["timestamp_end"] == [19 * SECOND]
