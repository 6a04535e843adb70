"""Parameter sets compared over some logs, without a pipeline: the figures that a decision is made of."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from fusetune.analyze.analyze_flight import analyze_flight
from fusetune.apply.decide import decide as decide_sets
from fusetune.apply.evidence import trust_grade
from fusetune.apply.statistics.rounding import without_rounding
from fusetune.design.parameter_check import checked_values
from fusetune.errors import UserError
from fusetune.library.log import Log
from fusetune.report.comparison import percent_change
from fusetune.running.worker_processes import all_cores, worker_processes
from fusetune.save.flights_table import write_flights_table
from fusetune.save.log_folder import demand_own_folders, save_log
from fusetune.save.present import Present, find_present
from fusetune.set_names import AS_FLOWN, ONBOARD, PRESENT
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

_OWN = (PRESENT, AS_FLOWN, ONBOARD)


@dataclass(frozen=True)
class Comparison:
    """How sets did on some flights, each against the present one: what the vehicle flies now.

    Attributes
    ----------
    changes : flights × sets, change of the prediction error against the present set's, percent; below 0 is better.
        A flight that has no say has no row
    ranking : one row per set, the present one first: `set`, `status`, `change_percent` with `lower_percent` and
        `upper_percent` (95 % interval over flights and blocks of them), `p_value`, `flights`, `flights_better`
    metrics : every figure of docs/metrics.md: flight, set, source, axis, metric, value, lower, upper, n
    flights : one row per log: verdict, reason, trust grade, whether it has a say
    answer : what follows, in sentences
    """

    changes: pd.DataFrame
    ranking: pd.DataFrame
    metrics: pd.DataFrame
    flights: pd.DataFrame
    answer: str

    def __str__(self) -> str:
        return self.answer

    def metric(self, name: str, source: str, axis: str = "all") -> pd.DataFrame:
        """One figure as a table, flights × sets.

        Raises
        ------
        KeyError
            No flight has it.
        """
        table = self.metrics
        rows = table[(table["metric"] == name) & (table["source"] == source) & (table["axis"] == axis)]
        if rows.empty:
            raise KeyError((source, axis, name))
        return rows.pivot(index="flight", columns="set", values="value")


def compare(
    logs: Sequence[AnyPath | Log],
    sets: Mapping[str, Mapping[str, float]],
    *,
    cores: int | None = None,
) -> Comparison:
    """Replay sets on logs and compare them, as the pipeline does with a study of these sets.

    Parameters
    ----------
    logs : `.ulg` files, or what `read` gave, each with a file name of its own
    sets : name → the parameters in which it differs from the present ones. The present set, what the newest log's
        vehicle flew at its end, is compared with and need not be named
    cores : flights that are worked on at a time; by default all cores

    Raises
    ------
    UserError
        No log can be replayed, a set has a name of the product's own, PX4 has no such parameter or forbids a value.
    """
    asked = {name: checked_values(values, f"set {name}") for name, values in sets.items()}
    for name in asked:
        if name in _OWN:
            raise UserError(f"set {name}", "has a name that means something already", "Name it otherwise")
    paths = [one.path if isinstance(one, Log) else Path(one) for one in logs]
    demand_own_folders(paths)
    with tempfile.TemporaryDirectory(prefix="fusetune_compare_") as scratch:
        return _Work(Path(scratch), asked).compared(paths, cores or all_cores())


@dataclass(frozen=True)
class _Work:
    folder: Path
    sets: Mapping[str, Mapping[str, float]]

    def compared(self, logs: Sequence[Path], cores: int) -> Comparison:
        saved = {path.stem: self.folder / "save" / path.stem for path in logs}
        table = self.folder / "save" / "flights.parquet"
        processes = min(cores, len(logs))
        if processes > 1:
            with worker_processes(processes) as pool:
                list(pool.map(save_log, logs, saved.values()))
                rows = write_flights_table(list(saved.values()), table, table.with_suffix(".csv"))
                present = self._present(rows, saved)
                list(pool.map(_analyze, *self._asked(rows, saved, present)))
        else:
            # worked on here, where all is imported
            for path, one in zip(logs, saved.values(), strict=True):
                save_log(path, one)
            rows = write_flights_table(list(saved.values()), table, table.with_suffix(".csv"))
            present = self._present(rows, saved)
            for asked in zip(*self._asked(rows, saved, present), strict=True):
                _analyze(*asked)
        return self._read(rows, present, table)

    def _present(self, rows: Sequence[Mapping], saved: Mapping[str, Path]) -> Present:
        varied = sorted({name for values in self.sets.values() for name in values})
        present = find_present(rows, saved, varied, None)
        if present.flight is None:
            reasons = "; ".join(f"{row['flight']}: {row['reason']}" for row in rows)
            raise UserError("the logs", f"none can be replayed ({reasons})", "Give a log that `read` calls replayable")
        return present

    def _asked(self, rows: Sequence[Mapping], saved: Mapping[str, Path], present: Present) -> tuple[list, ...]:
        flights = _replayable(rows)
        values = {PRESENT: present.parameters, AS_FLOWN: {}} | {
            name: {**present.parameters, **own} for name, own in self.sets.items()
        }
        return (
            [saved[name] for name in flights],
            [self.folder / "analyze" / name for name in flights],
            [values] * len(flights),
            [[PRESENT, *self.sets]] * len(flights),
        )

    def _read(self, rows: Sequence[Mapping], present: Present, table: Path) -> Comparison:
        folders = [self.folder / "analyze" / name for name in _replayable(rows)]
        out = self.folder / "apply"
        decide_sets(
            folders,
            table,
            out,
            sets=[PRESENT, *self.sets],
            newest_flight=present.flight,
            same_present=present.same,
            saved=table.parent,
        )
        decision = read_document(out / "decision.json")
        metrics = pd.concat([read_table(one / "metrics.parquet").to_pandas() for one in folders], ignore_index=True)
        return Comparison(
            changes=_changes(read_table(out / "per_flight.parquet").to_pandas(), [*self.sets]),
            ranking=ranking_table(read_table(out / "ranking.parquet").to_pandas()),
            metrics=metrics,
            flights=_flights(rows, decision, {one.name: trust_grade(one)[0] for one in folders}),
            answer=decision["paragraph"],
        )


def _analyze(saved: Path, folder: Path, replayed: Mapping[str, Mapping[str, float]], scored: Sequence[str]) -> None:
    analyze_flight(saved, folder, replayed, scored)


def _replayable(rows: Sequence[Mapping]) -> list[str]:
    return [row["flight"] for row in rows if row["status"] == "replayable"]


def _changes(per_flight: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    scores = per_flight.pivot(index="flight", columns="set", values="score")
    names = [name for name in names if name in scores]
    differences = without_rounding(scores[names].to_numpy() - scores[[PRESENT]].to_numpy())
    return pd.DataFrame(percent_change(differences), index=scores.index, columns=pd.Index(names, name="set"))


def ranking_table(ranking: pd.DataFrame) -> pd.DataFrame:
    """What people read of `ranking.parquet`."""
    table = ranking[["name", "status"]].rename(columns={"name": "set"})
    for name, column in {"change": "difference", "lower": "lower", "upper": "upper"}.items():
        table[f"{name}_percent"] = percent_change(ranking[column])
    for column in ("p_value", "flights", "flights_better"):
        table[column] = ranking[column]
    return table


def _flights(rows: Sequence[Mapping], decision: Mapping, grades: Mapping[str, str | None]) -> pd.DataFrame:
    judged = {row["flight"]: row for row in decision["flights"]}
    return pd.DataFrame(
        [
            {
                "flight": row["flight"],
                "verdict": row["status"],
                "trust": grades.get(row["flight"]),
                "has_a_say": bool(judged.get(row["flight"], {}).get("scored", False)),
                "reason": judged.get(row["flight"], {}).get("reason") or row["reason"],
            }
            for row in rows
        ]
    )
