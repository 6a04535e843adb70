"""Sets that are scored together, and the file that keeps their scores: each comes out as if it were alone."""

import sqlite3
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from tests.analyze.made_flight import MadeSet, make_flight

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.kept_scores import kept_scores
from fusetune.analyze.scoring.score_sets import scored_flight
from fusetune.analyze.scoring.set_scores import TABLES, SetScores, score_set, score_together
from fusetune.analyze.scoring.yardstick import Yardstick
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight

SETS = {
    "present": MadeSet(),
    "loose": MadeSet(error=0.3, claimed=0.2),
    "resets": MadeSet(resets_s=(30.0, 41.0)),
    "late": MadeSet(aiding_s=40.0),
    "wild": MadeSet(error=2.0, claimed=0.1),
}


class Scored(NamedTuple):
    yardstick: Yardstick
    records: list[ReplayedSet]
    alone: dict[str, SetScores]


@pytest.fixture(scope="module")
def scored(tmp_path_factory: pytest.TempPathFactory) -> Scored:
    """Sets of a made flight, and the scores of each by itself."""
    save, folder = make_flight(tmp_path_factory.mktemp("made"), "flight", SETS, truth=True)
    records = [read_set(folder, name) for name in SETS]
    yardstick = Yardstick(scored_flight(canonical(load_flight(save))), records[0])
    return Scored(yardstick, records, {one.name: score_set(yardstick, one) for one in records})


def assert_same(one: SetScores, other: SetScores) -> None:
    assert one.summary == other.summary
    for name in TABLES:
        ours, theirs = getattr(one, name), getattr(other, name)
        assert ours.schema == theirs.schema
        # Arrow has NaN differ from itself
        for column in ours.column_names:
            np.testing.assert_array_equal(
                ours[column].to_numpy(), theirs[column].to_numpy(), err_msg=f"{name} {column}"
            )


def test_sets_scored_together_have_the_scores_that_each_has_alone(scored: Scored) -> None:
    """Also beside sets that reset, lack most of the evidence or reject nearly all of it."""
    together = score_together(scored.yardstick, scored.records)
    assert len({len(one.metrics) for one in together}) > 1, "they are not all of one kind"
    for record, scores in zip(scored.records, together, strict=True):
        assert_same(scores, scored.alone[record.name])


def test_what_was_kept_together_comes_back_set_by_set(scored: Scored, tmp_path: Path) -> None:
    path = tmp_path / "scores.sqlite"
    with kept_scores(path) as kept:
        kept.keep(scored.alone)
        kept.keep({"again": scored.alone["loose"]})
    with kept_scores(path) as kept:
        for name, scores in scored.alone.items():
            assert kept.has(name)
            assert_same(kept.scores(name), scores)
        # of itself alone, whatever was kept with it
        for name in ("set", "source"):
            of_one, alone = (
                one.samples[name].chunk(0).dictionary for one in (kept.scores("loose"), scored.alone["loose"])
            )
            assert of_one.equals(alone)
        kept.drop_others({"wild", "late", "again"})
    with kept_scores(path) as kept:
        assert [name for name in (*SETS, "again") if kept.has(name)] == ["late", "wild", "again"]
        assert_same(kept.scores("late"), scored.alone["late"])
        with pytest.raises(KeyError):
            kept.scores("loose")


@pytest.mark.parametrize("column", ["head", "tables", "digest"])
def test_what_is_damaged_is_not_there_and_costs_the_others_nothing(scored: Scored, tmp_path: Path, column: str) -> None:
    path = tmp_path / "scores.sqlite"
    with kept_scores(path) as kept:
        kept.keep({name: scored.alone[name] for name in ("present", "loose")})
        kept.keep({"late": scored.alone["late"]})
    with sqlite3.connect(path) as database:
        (whole,) = database.execute(f"SELECT {column} FROM kept WHERE number = 1").fetchone()
        spoiled = bytes([whole[0] ^ 1]) + whole[1:]
        database.execute(f"UPDATE kept SET {column} = ? WHERE number = 1", (spoiled,))
    with kept_scores(path) as kept:
        assert [name for name in SETS if kept.has(name)] == ["late"]
        kept.keep({"loose": scored.alone["loose"]})
        assert_same(kept.scores("loose"), scored.alone["loose"])
