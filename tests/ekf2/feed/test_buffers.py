"""Ring buffers against a plain list that keeps every sample (hypothesis), and PX4's special cases by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.ekf2.feed.buffers import (
    MAX_SAMPLE_AGE_US,
    RING,
    find_newest_due,
    may_be_due,
    newest_time_us,
    push,
    reset_ring,
    take,
)


def make_ring(size):
    ring = np.zeros(1, RING)
    reset_ring(ring[0], size)
    return ring[0]


def pop(ring, horizon_us):
    index = find_newest_due(ring, horizon_us)
    assert index < 0 or may_be_due(ring, horizon_us)
    if index < 0:
        return None
    slot = int(ring["slot"][index])
    take(ring, index)
    return slot


class NaiveBuffer:
    """The same rules on a list: newest due sample wins, everything older goes, a full buffer drops its oldest."""

    def __init__(self, size):
        self.size, self.samples = size, []

    def push(self, time_us, slot):
        self.samples = [*self.samples, (time_us, slot)][-self.size :]

    def pop(self, horizon_us):
        due = [i for i, (t, _) in enumerate(self.samples) if t <= horizon_us < t + MAX_SAMPLE_AGE_US]
        if not due:
            return None
        slot = self.samples[due[-1]][1]
        self.samples = self.samples[due[-1] + 1 :]
        return slot


@settings(max_examples=200, deadline=None)
@given(
    size=st.integers(2, 8),
    steps=st.lists(st.tuples(st.booleans(), st.integers(1, 60_000)), max_size=60),
)
def test_ring_agrees_with_a_plain_list(size, steps):
    ring, naive = make_ring(size), NaiveBuffer(size)
    pushed_us, horizon_us = 1_000_000, 1_000_000
    for slot, (is_push, step) in enumerate(steps):
        if is_push:
            pushed_us += step
            push(ring, pushed_us, slot)
            naive.push(pushed_us, slot)
        else:
            horizon_us += step
            assert pop(ring, horizon_us) == naive.pop(horizon_us)


def test_sample_older_than_a_tenth_of_a_second_is_never_due():
    ring = make_ring(4)
    push(ring, 1_000_000, 0)
    assert pop(ring, 1_000_000 + MAX_SAMPLE_AGE_US) is None
    assert pop(ring, 1_000_000 + MAX_SAMPLE_AGE_US - 1) == 0


def test_emptied_ring_forgets_the_time_of_its_newest_sample():
    ring = make_ring(4)
    push(ring, 5_000_000, 7)
    assert newest_time_us(ring) == 5_000_000
    assert pop(ring, 5_000_000) == 7
    assert newest_time_us(ring) == 0


@pytest.mark.parametrize("size", [2, 3, 255])
def test_full_ring_drops_its_oldest(size):
    ring = make_ring(size)
    for slot in range(size + 1):
        push(ring, 1_000_000 + slot, slot)
    assert pop(ring, 1_000_000) is None
    assert pop(ring, 1_000_001) == 1
