"""What is packed fits, and what was thinned still reaches as far as it did."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.report.flight_data.blob import unpack
from fusetune.report.flight_data.content import FlightContent, Panel, Series, ShownSet, with_gaps
from fusetune.report.flight_data.packing import pack_content
from fusetune.report.flight_data.preparing import prepared

START = 5_000_000
ROWS = 20_000


def noisy(name: str | None, seed: int) -> Series:
    generator = np.random.default_rng(seed)
    time = START + np.arange(ROWS, dtype=np.int64) * 10_000
    values = generator.standard_t(2.0, ROWS)
    return Series(
        name or "GNSS", time, values, name, sigma=np.full(ROWS, 0.5), gate=3.0, rejected=np.abs(values) > 30.0
    )


SETS = (ShownSet("present", "present", 0, "circle"), ShownSet("other", "candidate", 3, "square"))


@pytest.fixture(scope="module")
def panels() -> tuple[Panel, ...]:
    return tuple(
        Panel(f"innovation.gnss_vel.{axis}", "Innovations", "GNSS velocity", "m/s", tuple(
            noisy(name, 3 * axis + number) for number, name in enumerate(("present", "other", None))
        ), "innovation", "gnss_vel", axis)
        for axis in range(3)
    )  # fmt: skip


@pytest.fixture(scope="module")
def content(panels: tuple[Panel, ...]) -> FlightContent:
    ready = tuple(prepared(one, START) for one in panels)
    return FlightContent("made", "made", START, 200.0, 10.0, None, SETS, ready, (), (), (), None)


@pytest.mark.parametrize("budget", [15_000, 30_000, 60_000])
def test_it_fits_and_no_peak_is_lost(panels: tuple[Panel, ...], content: FlightContent, budget: int) -> None:
    blob = pack_content(content, budget)
    # base64 makes four characters of three bytes
    assert 0.6 * budget < len(blob) * 4 / 3 <= budget
    header, arrays = unpack(blob)
    counts = {"present": 0, "other": 0}
    for panel, packed in zip(panels, header["panels"], strict=True):
        for series, told in zip(panel.series, packed["series"], strict=True):
            values, time = arrays[told["value"]], arrays[told["time"]]
            assert values.max() == pytest.approx(series.values.max(), rel=2**-17)
            assert values.min() == pytest.approx(series.values.min(), rel=2**-17)
            assert values[0] == pytest.approx(series.values[0], rel=2**-17)
            # every one is a sample, at its own time
            rows = np.rint(time * 100.0).astype(int)
            np.testing.assert_allclose(time, (series.time[rows] - START) * 1e-6, atol=1e-9)
            np.testing.assert_allclose(values, series.values[rows], rtol=2**-17)
            assert series.rejected is not None
            assert arrays[told["rejected"]].astype(bool).tolist() == series.rejected[rows].tolist()
            assert (told["samples"], told["rejected_samples"]) == (ROWS, series.rejected.sum())
            if told["set"]:
                counts[told["set"]] += len(values)
    assert counts["other"] < counts["present"], "the sets that matter less are thinned first"


def test_what_is_of_no_set_has_a_colour_that_no_set_beside_it_has(content: FlightContent) -> None:
    header = unpack(pack_content(content, 30_000)).header
    assert [one["style"] for one in header["panels"][0]["series"]] == [0, 3, 1]


def test_a_flight_that_cannot_fit_is_as_coarse_as_can_be(content: FlightContent) -> None:
    blob = pack_content(content, 100)
    assert all(unpack(blob).header["arrays"][one["value"]]["count"] < 200
               for panel in unpack(blob).header["panels"] for one in panel["series"])  # fmt: skip


def test_what_is_packed_is_in_order_and_begins_with_the_log() -> None:
    """A delayed sensor's first samples hold for a time before it."""
    series = Series("one", np.array([START + 100, START - 2, START]), np.array([9.0, 7.0, 8.0]))
    (ready,) = prepared(Panel("baro_height", "Sensors", "Height", "m", (series,)), START).series
    assert ready.time.tolist() == [START, START + 100]
    assert ready.values.tolist() == [8.0, 9.0]
    assert (ready.samples, ready.rejected_samples) == (2, None)


def test_a_line_is_parted_where_there_is_long_no_sample() -> None:
    time = np.r_[np.arange(10), np.arange(100, 110)] * 100_000
    values = np.arange(20.0)
    found, (filled, flags) = with_gaps(time, (values, values > 5.0))
    assert np.isnan(filled).tolist() == [False] * 10 + [True] + [False] * 10
    assert found[10] == time[9] + 100
    assert not flags[10]
    back, (same,) = with_gaps(time[::-1], (values[::-1],))
    assert back.tolist() == found.tolist()
    assert np.array_equal(same, filled, equal_nan=True)
