"""Scores by piece: all pieces together are the blocks together, and each sample is in the piece of its time."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pytest
from tests.analyze.made_flight import LANDING_S, START_US, TAKE_OFF_S, MadeSet, make_flight

from fusetune.analyze.conformance.flight_pieces import NO_LEG, flight_pieces
from fusetune.analyze.conformance.mission_totals import mission_totals
from fusetune.analyze.conformance.split_scores import write_legs
from fusetune.analyze.scoring.score_flight import score_saved_flight
from fusetune.storage.documents import write_document
from fusetune.storage.parquet import read_table

SETS = {"present": MadeSet(error=0.13), "better": MadeSet(error=0.1)}


def at(seconds: float) -> int:
    return START_US + round(1e6 * seconds)


def made_conformance(flight: str) -> dict[str, Any]:
    """Hover, turn and straight in turn, 7 s each, and two legs of a mission, 12 s to 30 s and 30 s to 50 s."""
    edges = np.arange(TAKE_OFF_S, LANDING_S + 7.0, 7.0)
    kinds = ("hover", "turn", "straight")
    moments = [
        {"kind": kinds[number % 3], "start_us": at(start), "stop_us": at(stop)}
        for number, (start, stop) in enumerate(pairwise(edges))
    ]
    legs = [
        {"leg": number, "kind": "travel", "waypoint": number, "start_us": at(start), "stop_us": at(stop)}
        for number, (start, stop) in enumerate(((12.0, 30.0), (30.0, 50.0)))
    ]
    ground = {"kind": "ground", "start_us": at(0.0), "stop_us": at(TAKE_OFF_S)}
    return {
        "flight": flight,
        "flown": "lanes",
        "missions": [{"mission": "lanes", "legs": legs}],
        "manoeuvres": [ground, *moments],
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`results/analyze/<flight>` of a made flight, scored and compared."""
    save, folder = make_flight(tmp_path_factory.mktemp("study"), "flight", SETS, seed=3)
    score_saved_flight(save, folder, list(SETS))
    write_document(folder / "conformance.json", made_conformance("flight"))
    return folder


def test_all_pieces_together_are_the_blocks_together(folder: Path, tmp_path: Path) -> None:
    write_legs([folder], tmp_path / "legs.parquet")
    legs = read_table(tmp_path / "legs.parquet").to_pandas()
    for aim, file, values in (
        ("aided", "scores.parquet", ("sum_nis_winsorised", "sum_log_variance", "sum_nll")),
        ("smoothed", "smoothed.parquet", ("sum_squares_winsorised",)),
    ):
        whole = read_table(folder / file).to_pandas().groupby(["set", "source", "axis"])
        keys = ["set", "source", "axis"]
        parts = legs[legs.aim == aim].astype({"set": str, "source": str}).groupby(keys)
        assert set(parts.groups) <= set(whole.groups)
        assert aim != "aided" or parts.ngroups > 5
        for name in values:
            own = {"sum_nis_winsorised": "sum_nis", "sum_squares_winsorised": "sum_squares"}.get(name, name)
            expected = whole[name].sum()
            for key, value in parts[own].sum().items():
                # samples are kept in single precision
                assert value == pytest.approx(expected[key], rel=1e-5)
        assert all(parts["n"].sum() == whole["n"].sum()[parts["n"].sum().index])
    gaps = read_table(folder / "withheld.parquet").to_pandas()
    assert legs[legs.aim == "unaided"].n.sum() == len(gaps)
    assert legs[legs.aim == "unaided"].sum_squares.sum() == pytest.approx((gaps.error_winsorised**2).sum())


def test_each_sample_is_in_the_piece_and_leg_of_its_time(folder: Path, tmp_path: Path) -> None:
    write_legs([folder], tmp_path / "legs.parquet")
    legs = read_table(tmp_path / "legs.parquet")
    samples = read_table(folder / "samples.parquet")
    mine = samples.filter(
        pc.and_(
            pc.and_(pc.equal(samples["set"], "better"), pc.equal(samples["source"], "gnss_vel")),
            pc.equal(samples["axis"], 0),
        )
    )
    time, error = mine["time_us"].to_numpy(), mine["innovation"].to_numpy().astype(np.float64)
    # the second turn, from 38 s to 45 s, lies within the second leg
    rows = (time >= at(38.0)) & (time < at(45.0))
    wanted = {"set": "better", "source": "gnss_vel", "axis": 0, "class": "turn", "leg": 1, "aim": "aided"}
    found = [row for row in legs.to_pylist() if all(row[name] == value for name, value in wanted.items())]
    first = min(found, key=lambda row: row["piece"])
    assert sum(row["n"] for row in found) == np.count_nonzero(rows)
    limit = float(mine["winsor_limit"][0].as_py())
    assert first["mission"] == "lanes"
    assert sum(row["sum_squares"] for row in found) == pytest.approx(
        float(np.sum(np.clip(error[rows], -limit, limit) ** 2)), rel=1e-6
    )


def test_pieces_cover_the_air_and_are_cut_where_legs_change() -> None:
    pieces = flight_pieces(made_conformance("flight"))
    assert pieces.mission == "lanes"
    assert list(pieces.start[1:]) == list(pieces.stop[:-1])
    assert {at(12.0), at(30.0), at(50.0)} <= {*pieces.start.tolist()}
    assert list(pieces.at(np.array([at(5.0), at(11.0), at(13.0), at(49.9), at(55.0)]))[:1]) == [-1]
    of_leg = pieces.leg[pieces.at(np.array([at(11.0), at(13.0), at(49.9), at(55.0)]))]
    assert of_leg.tolist() == [NO_LEG, 0, 1, NO_LEG]


def test_what_all_flights_made_of_a_mission_adds_up() -> None:
    def flight(name: str, flown: str | None, passed: list[bool], beside: float | None) -> dict[str, Any]:
        figures = None if beside is None else {
            "cross_track_mean": beside, "cross_track_bias": -beside, "height_error_mean": 0.1, "speed": 5.0,
            "cross_track_95": 2.0 * beside, "cross_track_max": 3.0 * beside, "height_error_max": 0.2,
        }  # fmt: skip
        waypoints = [{"passed": one, "in_order": one, "miss_m": 1.0} for one in passed]
        leg = {"leg": 0, "kind": "travel", "waypoint": 0, "planned_speed_m_s": 6.0, "figures": figures}
        verdict = "flew" if all(passed) else "flew in part"
        return {"flight": name, "flown": flown, "missions": [
            {"mission": "lanes", "verdict": verdict, "waypoints": waypoints, "legs": [leg]}
        ]}  # fmt: skip

    found = mission_totals(
        [
            flight("a", "lanes", [True, True], 0.2),
            flight("b", "lanes", [True, False], 0.4),
            flight("c", None, [True, False], 9.0),
        ]
    )
    assert [one["mission"] for one in found] == ["lanes"]
    flights, waypoints, legs = (found[0][name] for name in ("flights", "waypoints", "legs"))
    assert flights == {"flew": ["a"], "flew in part": ["b"], "flew otherwise": [], "not this mission": ["c"]}
    assert [(one["in_order"], one["missed"], one["flights"]) for one in waypoints] == [(2, 0, 2), (1, 1, 2)]
    assert (legs[0]["flights"], legs[0]["speed"]) == (2, 5.0)
    assert legs[0]["cross_track_mean"] == pytest.approx(0.3)
    assert legs[0]["cross_track_max"] == pytest.approx(1.2)
