"""In which order sets are flown, so that battery, time of day and the flight before favour none of them.

Flights come in blocks of as many as there are sets: each block holds every set once. Blocks are rows of Williams'
squares, in which every set follows every other one equally often, so that what one flight leaves to the next (a warm
motor, a learned bias) is shared alike: an even number of sets takes one square, an odd one a square and its mirror
image. Sets are drawn to the letters of each square by chance, and so are its rows to blocks.

References
----------
Williams, "Experimental designs balanced for the estimation of residual effects of treatments", Australian Journal of
Scientific Research A 2(2), 1949.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def williams_rows(count: int) -> list[list[int]]:
    """Rows of Williams' square for `count` treatments: `count` of them where it is even, else twice as many.

    The first row is 0, 1, n − 1, 2, n − 2, …, whose neighbours differ by every amount once; the others add 1 each.
    """
    first = [(step + 1) // 2 if step % 2 else (count - step // 2) % count for step in range(count)]
    rows = [[(one + shift) % count for one in first] for shift in range(count)]
    return rows if count % 2 == 0 else rows + [row[::-1] for row in rows]


def flight_order(sets: Sequence[str], blocks: int, seed: int) -> list[list[str]]:
    """Sets in the order in which they are flown, block by block; more blocks leave the first ones as they are.

    Parameters
    ----------
    sets : names, at least two
    blocks : how many times each set is flown
    """
    found: list[list[str]] = []
    square = 0
    while len(found) < blocks:
        # a generator of its own for each square: what comes later has no say in it
        generator = np.random.Generator(np.random.PCG64([seed, square]))
        names = [sets[index] for index in generator.permutation(len(sets))]
        rows = williams_rows(len(sets))
        found += [[names[letter] for letter in rows[index]] for index in generator.permutation(len(rows))]
        square += 1
    return found[:blocks]
