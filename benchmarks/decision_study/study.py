"""Everything that is found out about one world; worlds are independent, and each is a job."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fusetune.apply.settings import DecisionSettings

from .drawn import JUDGED_SIZES, DrawnStudy, draw_studies
from .judge import Verdict, judge_world
from .nulls import coverage, false_changes
from .tables import truth_table
from .world import read_world

SEED = 20


@dataclass(frozen=True)
class Sizes:
    """How much is drawn.

    Attributes
    ----------
    flights : of the one study that is judged
    resamples, null_studies, intervals : studies drawn of each kind and number of flights; those of equal sets; those
        that show whether the intervals hold
    quick_draws : of the bootstrap in drawn studies
    """

    flights: int = 8
    resamples: int = 30
    null_studies: int = 1000
    intervals: int = 40
    quick_draws: int = 200


@dataclass(frozen=True)
class StudiedWorld:
    """What was found out; `false_changes` by number of flights, rule and kind, `covered` by number of flights."""

    name: str
    verdicts: list[Verdict]
    drawn: list[DrawnStudy]
    false_changes: dict[tuple[int, str, str], float]
    covered: dict[int, float]
    truth: str


def study_world(
    name: str, folders: Sequence[Path], overrides: Mapping[str, Mapping[str, float]], sizes: Sizes
) -> StudiedWorld:
    """Decide and judge in one world."""
    settings = DecisionSettings(seed=SEED)
    quick = replace(settings, draws=sizes.quick_draws)
    world = read_world(name, folders, overrides, settings)
    # Each world has its own chance, whichever others are studied.
    chance = [np.random.default_rng((SEED, zlib.crc32(name.encode()), part)) for part in range(3)]
    return StudiedWorld(
        name,
        judge_world(world, min(sizes.flights, len(world.flights)), settings),
        draw_studies(world, sizes.resamples, quick, chance[0]),
        {
            (flights, *key): share
            for flights in JUDGED_SIZES
            for key, share in false_changes(world, flights, sizes.null_studies, quick, chance[1]).items()
        },
        {flights: coverage(world, flights, sizes.intervals, quick, chance[2]) for flights in JUDGED_SIZES},
        truth_table(world),
    )


def study_worlds(
    folders: Mapping[str, Sequence[Path]],
    overrides: Mapping[str, Mapping[str, float]],
    sizes: Sizes,
    workers: int,
) -> list[StudiedWorld]:
    """All worlds, in their order."""
    with ProcessPoolExecutor(workers) as pool:
        running = [pool.submit(study_world, name, paths, overrides, sizes) for name, paths in folders.items()]
        return [one.result() for one in running]
