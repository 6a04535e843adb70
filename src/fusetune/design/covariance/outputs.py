"""What a covariance design leaves on disk: tables for people and for programs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa

from fusetune.design.covariance.evaluation import BASELINE, Deviations, Evaluation
from fusetune.storage.csv_file import write_csv
from fusetune.storage.files import AnyPath

COVARIANCE, PAYS, SWEEPS = "covariance.csv", "pays_most.csv", "sweeps.csv"

_COVARIANCE = pa.schema(
    [
        ("variation", pa.string()),
        ("state", pa.string()),
        ("unit", pa.string()),
        ("sd_before_correction", pa.float64()),
        ("sd_before_correction_largest", pa.float64()),
        ("sd_at_present", pa.float64()),
        ("change_percent", pa.float64()),
    ]
)
_PAYS = pa.schema(
    [
        ("state", pa.string()),
        ("rank", pa.int64()),
        ("sensor", pa.string()),
        ("improvement", pa.string()),
        ("change_percent", pa.float64()),
    ]
)
_SWEEPS = pa.schema(
    [
        ("sweep", pa.string()),
        ("changed", pa.string()),
        ("value_or_factor", pa.float64()),
        ("state", pa.string()),
        ("unit", pa.string()),
        ("sd_before_correction", pa.float64()),
        ("sd_at_present", pa.float64()),
    ]
)


def write_evaluation(evaluation: Evaluation, folder: AnyPath) -> None:
    """Write `covariance.csv`, a row for each variation and state, `pays_most.csv` and `sweeps.csv`."""
    target = Path(folder)
    _write(target / COVARIANCE, _COVARIANCE, _covariance_rows(evaluation))
    _write(target / PAYS, _PAYS, _pays_rows(evaluation))
    _write(target / SWEEPS, _SWEEPS, _sweep_rows(evaluation))


def _write(path: Path, schema: pa.Schema, rows: Iterator[tuple]) -> None:  # type: ignore[type-arg]
    write_csv(path, pa.Table.from_pylist([dict(zip(schema.names, row, strict=True)) for row in rows], schema))


def _covariance_rows(evaluation: Evaluation) -> Iterator[tuple]:  # type: ignore[type-arg]
    yield from _of_variation(BASELINE, evaluation.base, evaluation.base)
    for one in evaluation.evaluated:
        yield from _of_variation(one.name, one.deviations, evaluation.base)


def _of_variation(name: str, deviations: Deviations, base: Deviations) -> Iterator[tuple]:  # type: ignore[type-arg]
    for state, told in deviations.items():
        designed = base[state].judged if state in base else 0.0
        change = 100.0 * (told.judged / designed - 1.0) if designed > 0.0 else None
        yield name, state, told.unit, told.before, told.largest, told.now, change


def _pays_rows(evaluation: Evaluation) -> Iterator[tuple]:  # type: ignore[type-arg]
    for state in evaluation.judged:
        for rank, one in enumerate(evaluation.pays_most(state), 1):
            of = one.alternative
            if of is not None:
                what = f"{of.subject} {of.what}"
                yield state, rank, of.sensor, what, 100.0 * one.change(evaluation.base, state)


def _sweep_rows(evaluation: Evaluation) -> Iterator[tuple]:  # type: ignore[type-arg]
    for point in evaluation.points:
        for state, told in point.deviations.items():
            yield point.sweep, point.line, point.point, state, told.unit, told.before, told.now
