"""Pairs of flight and set are tried once, and kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from fusetune.analyze.delays.lag import Lag
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.analyze.trials.tried_set import ONE_STEP, WITHHELD, Column, Rejections, Sums, TriedSet
from fusetune.apply.search.comparison import TriedBase
from fusetune.apply.search.kept_pairs import KeptPairs
from fusetune.apply.search.replays import MOST_IN_BATCH, Batch, ReplayGround, Tried, tells_place
from fusetune.apply.search.requests import Ask, values_of
from fusetune.apply.settings import DecisionSettings

BASE = values_of({"EKF2_ACC_NOISE": 0.35})
SETS = tuple(values_of({"EKF2_ACC_NOISE": 0.1 * number}) for number in range(1, 13))
DID = TriedSet(
    sums={
        Column(ONE_STEP, "gnss_vel", 0): Sums(10.0, 3.25, -7.5),
        Column(WITHHELD, "gnss_pos", 1, 9.0): Sums(4.0, 0.1, 0.0),
    },
    flight_s=61.5,
    significant_resets=1,
    timeouts=2,
    fault_s={"fs_bad_hdg": 0.5},
    rejections={("gnss_vel", 0): Rejections(1, 10)},
)


class Counting:
    """A trier whose sets all do the same, and that counts how often each pair is tried."""

    def __init__(self) -> None:
        self.tried: Counter = Counter()
        self.batches: list[Batch] = []

    def try_batches(self, batches: Sequence[Batch]) -> Iterator[tuple[Batch, Tried]]:
        self.batches += batches
        for flight, base, sets in batches:
            self.tried.update((flight, base, one) for one in sets)
            yield (flight, base, sets), (TriedBase("", {"gnss_vel": 0.9}, DID), (DID,) * len(sets))


def test_a_pair_is_tried_once_whichever_searches_ask_for_it() -> None:
    trier = Counting()
    ground = ReplayGround(trier, DecisionSettings())
    asks = [(("a", "b"), Ask("all", BASE, SETS)), (("b",), Ask("all", BASE, SETS[:3]))]
    first = ground.compare(asks)
    again = ground.compare(asks)
    assert set(trier.tried.values()) == {1}
    assert len(trier.tried) == ground.replayed == 2 * len(SETS)
    assert max(len(sets) for _, _, sets in trier.batches) <= MOST_IN_BATCH
    assert [one.differences.tolist() for one in first] == [one.differences.tolist() for one in again]
    # all sets do as the base does
    assert first[0].differences.shape == (12, 2)
    assert not first[0].differences.any()


def test_what_was_kept_is_known_to_the_next_who_goes_on(tmp_path: Path) -> None:
    kept = KeptPairs(tmp_path, {"a": "log 1", "b": "log 2"})
    first = Counting()
    asks = [(("a", "b"), Ask("all", BASE, SETS))]
    ReplayGround(first, DecisionSettings(), kept.keep).compare(asks)

    second = Counting()
    ground = ReplayGround(second, DecisionSettings())
    for batch, tried in KeptPairs(tmp_path, {"a": "log 1", "b": "log 2"}).kept():
        assert tried[1] == (DID,) * len(batch[2])
        ground.know(batch, tried)
    ground.compare(asks)
    assert not second.tried


def test_what_another_log_or_program_made_or_is_damaged_is_tried_again(tmp_path: Path) -> None:
    kept = KeptPairs(tmp_path, {"a": "log 1", "b": "log 2"})
    ReplayGround(Counting(), DecisionSettings(), kept.keep).compare([(("a", "b"), Ask("all", BASE, SETS[:2]))])
    (file,) = (tmp_path / "b").iterdir()
    file.write_bytes(file.read_bytes()[:-30])
    assert not list(KeptPairs(tmp_path, {"a": "log 3", "b": "log 2"}).kept())


def test_before_delays_are_right_sources_are_trusted_all_the_same() -> None:
    ground = ReplayGround(Counting(), DecisionSettings())
    assert ground.weighed_by("delays").trust(0.0) == 1.0
    assert ground.weighed_by("all").trust(0.0) == 0.0


def test_a_place_that_was_told_once_stays_in_whatever_order_batches_come() -> None:
    """It is told where the base itself is compared, and batches of other sets come without."""
    place = VelocityPlace(Lag(0.11, 0.002, 100, 300), np.zeros(3), np.eye(3))
    with_base, without = (BASE, SETS[0]), SETS[1:3]
    batches = [("a", BASE, with_base), ("a", BASE, without)]
    assert [tells_place(batch) for batch in batches] == [True, False]
    tried = [
        (("a", BASE, sets), (TriedBase("", {}, DID, place if sets is with_base else None), (DID,) * len(sets)))
        for sets in (with_base, without)
    ]
    for order in (tried, tried[::-1]):
        ground = ReplayGround(Counting(), DecisionSettings())
        for batch, did in order:
            ground.know(batch, did)
        (compared,) = ground.compare([(("a",), Ask("delays", BASE, (BASE,)))])
        assert compared.places == (place,)
        # what is written of a batch follows from the batch, not from what else is known
        written = ground.pairs([(("a",), Ask("all", BASE, without))])
        assert [about.place for _, (about, _) in written] == [None]
