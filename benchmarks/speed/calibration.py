"""A fixed piece of work whose CPU time tells how fast this machine is at this moment."""

from __future__ import annotations

import time

import numpy as np

STEPS = 150_000
REPEATS = 12
SIZE = 24


def loop_s() -> float:
    """CPU seconds of the loop, the fastest of some: interpreted arithmetic, and products of matrices as large as P."""
    return min(_once() for _ in range(REPEATS))


def _once() -> float:
    begin = time.process_time()
    value, matrix = 0.0, np.full((SIZE, SIZE), 1.0 / SIZE)
    product = matrix
    for step in range(STEPS):
        value = 0.5 * value + step % 7
        if step % 15 == 0:
            product = matrix @ matrix
    took = time.process_time() - begin
    assert value > 0.0
    assert np.allclose(product, matrix)
    return took
