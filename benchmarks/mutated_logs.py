"""Damage a small log in every way a card, a crash or a bad copy does, and see that each case ends in a verdict.

    python -m benchmarks.mutated_logs [--cases 2000] [--seed 1]

A case is a number; the same number gives the same bytes. Beyond what fails any case (`benchmarks/damage_cases.py`), it
fails when a flight that is called replayable holds more samples that the sound log does not hold than single bits were
flipped, without a warning that the sound log does not have. (A bit that changes a value into another possible one
cannot be noticed: ULog has no checksums.)
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from benchmarks.damage_cases import (
    SENSORS,
    CaseError,
    Outcome,
    Sound,
    changed_rows,
    records_of,
    report,
    run_all,
    saved_case,
    sound_case,
    warned,
)

MOST_SILENT = 160
"""Samples that single flipped bits and values can change in one case: 50 and 30 in each of up to three ways."""
ABSURD_TIMES = (0, 1, 1 << 31, 1 << 40, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)
ABSURD_VALUES = (np.nan, np.inf, -np.inf, 1e30, -1e30, 1e-40)


@dataclass
class Mutator:
    """Damages one log; each method is one way of damage and returns the bytes."""

    sound: bytes

    def __post_init__(self) -> None:
        self.records = records_of(self.sound)
        self.data = [(begin, end) for begin, end in self.records if self.sound[begin + 2] == ord("D")]
        self.definitions_end = self.data[0][0]
        self.ways: tuple[Callable[[bytearray, np.random.Generator], bytearray], ...] = (
            self.bit_flips,
            self.bit_flips_in_definitions,
            self.truncation,
            self.removal,
            self.repetition,
            self.exchange,
            self.shuffled_records,
            self.sizes,
            self.time_stamps,
            self.values,
            self.rubbish,
        )

    def mutated(self, seed: int) -> tuple[bytes, str]:
        """The bytes of a case, with the names of what was done."""
        rng = np.random.default_rng(seed)
        content, names = bytearray(self.sound), []
        for _ in range(int(rng.choice([1, 1, 2, 3]))):
            way = self.ways[int(rng.integers(len(self.ways)))]
            content = way(content, rng)
            names.append(way.__name__)
        return bytes(content), " + ".join(names)

    def bit_flips(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        return _flipped(content, rng, 0, len(content))

    def bit_flips_in_definitions(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        return _flipped(content, rng, 0, min(self.definitions_end, len(content)))

    def truncation(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        return content[: int(rng.integers(0, len(content) + 1))]

    def removal(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        begin, end = _slice(content, rng)
        return content[:begin] + content[end:]

    def repetition(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        begin, end = _slice(content, rng)
        place = int(rng.integers(0, len(content) + 1))
        return content[:place] + content[begin:end] + content[place:]

    def exchange(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        begin, end = _slice(content, rng)
        place = int(rng.integers(0, max(len(content) - (end - begin), 0) + 1))
        moved = bytearray(content)
        moved[begin:end], moved[place : place + end - begin] = content[place : place + end - begin], content[begin:end]
        return moved

    def shuffled_records(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        first = int(rng.integers(0, len(self.records)))
        last = min(first + int(rng.choice([2, 10, 200, 2000])), len(self.records) - 1)
        order = rng.permutation(np.arange(first, last + 1))
        middle = b"".join(self.sound[slice(*self.records[index])] for index in order)
        return content[: self.records[first][0]] + middle + content[self.records[last][1] :]

    def sizes(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        for begin, _ in self._some(self.records, rng):
            size = int(rng.choice([0, 1, 2, 0xFFFF, int(rng.integers(0x10000))]))
            content[begin : begin + 2] = size.to_bytes(2, "little")
        return content

    def time_stamps(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        for begin, _ in self._some(self.data, rng):
            absurd = int(rng.integers(1 << 64, dtype=np.uint64)) if rng.random() < 0.3 else int(rng.choice(7))
            value = absurd if absurd > 6 else ABSURD_TIMES[absurd]
            content[begin + 5 : begin + 13] = value.to_bytes(8, "little")
        return content

    def values(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        for begin, end in self._some(self.data, rng):
            place = begin + 13 + 4 * int(rng.integers(max((end - begin - 13) // 4, 1)))
            content[place : place + 4] = np.float32(rng.choice(ABSURD_VALUES)).tobytes()
        return content

    def rubbish(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        begin, end = _slice(content, rng)
        content[begin:end] = rng.integers(0, 256, end - begin, np.uint8).tobytes()
        return content

    def _some(self, places: list[tuple[int, int]], rng: np.random.Generator) -> Iterator[tuple[int, int]]:
        for _ in range(int(rng.choice([1, 3, 30]))):
            yield places[int(rng.integers(len(places)))]


def _flipped(content: bytearray, rng: np.random.Generator, begin: int, end: int) -> bytearray:
    if end > begin:
        for _ in range(int(rng.choice([1, 5, 50]))):
            content[int(rng.integers(begin, end))] ^= 1 << int(rng.integers(8))
    return content


def _slice(content: bytearray, rng: np.random.Generator) -> tuple[int, int]:
    begin = int(rng.integers(0, len(content) + 1))
    return begin, min(begin + int(rng.choice([1, 7, 100, 4096, 60_000])), len(content))


def run_case(content: bytes, folder: Path, sound: Sound) -> str:
    """Save damaged bytes and judge what came of it: the verdict's status.

    Raises
    ------
    CaseError
        As `saved_case`, or samples are not those of the sound log and no warning says so.
    """
    verdict, flight = saved_case(content, folder)
    for topic in SENSORS:
        table = None if flight is None else flight.topic(topic)
        changed = 0 if table is None else changed_rows(table, sound.tables[topic])
        if changed > MOST_SILENT and warned(verdict) <= sound.warnings:
            raise CaseError(f"{changed} samples of {topic} are not those of the sound log, and no warning says so")
    return verdict.status


def run_cases(seeds: range, folder: Path) -> Outcome:
    """Run cases."""
    sound = sound_case(folder)
    run_case(sound.content, folder, sound)
    return run_all(seeds, Mutator(sound.content).mutated, lambda content, _: run_case(content, folder, sound))


if __name__ == "__main__":
    sys.exit(report(__doc__, 2000, run_cases))
