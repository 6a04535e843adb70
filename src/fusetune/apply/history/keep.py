"""Keeps what was decided, judges what was decided before, and tells both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fusetune.apply.evidence import read_flights
from fusetune.apply.history.entries import (
    BEFORE,
    DecisionEntry,
    History,
    history_file,
    keep_decision,
    keep_outcome,
    read_history,
)
from fusetune.apply.history.flown import flown_flight
from fusetune.apply.history.judge import judge_change
from fusetune.apply.history.made_decision import decision_entry
from fusetune.apply.rounded import rounded
from fusetune.apply.settings import DecisionSettings
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import read_table


def keep_history(
    apply_folder: AnyPath,
    flights_table: AnyPath,
    saved: AnyPath,
    measured: Mapping[str, Sequence[AnyPath]],
    history_folder: AnyPath,
    output: AnyPath,
    settings: DecisionSettings,
) -> None:
    """Add a decision to the history of its vehicle, and before it what flights show of the changes before.

    Parameters
    ----------
    apply_folder : `results/apply`
    flights_table : `results/save/flights.parquet`
    saved : `results/save`
    measured : key of a decision → folders of `measure_change` of the flights that flew its change
    history_folder : `results/history`; nothing in it is ever rewritten
    output : `results/apply/history.json`, the history of this vehicle as the page tells it, without when it was written

    Raises
    ------
    UserError
        A file is damaged; nothing is added then.
    """
    decision = read_document(Path(apply_folder) / "decision.json")
    own = set(decision["vehicle"]["flights"]) if decision["vehicle"] is not None else set()
    rows = [row for row in read_table(flights_table).to_pylist() if row["flight"] in own]
    flown = {row["flight"]: flown_flight(row, Path(saved) / row["flight"]) for row in rows}
    entry = decision_entry(decision, read_table(Path(apply_folder) / "per_flight.parquet"), flown)
    history = History()
    if entry is not None:
        file = history_file(history_folder, entry.vehicle)
        for change in read_history(file).decisions:
            if change.key in measured:
                _judge(file, change, measured[change.key], settings)
        keep_decision(file, _rounded(entry))
        history = read_history(file)
    with atomic_path(output) as temporary:
        write_document(temporary, history_document(history))


def history_document(history: History) -> dict[str, Any]:
    """A history as the page tells it: every decision with the last word on it, oldest first."""
    return {"decisions": [_told(one, history) for one in history.decisions]}


def _judge(file: Path, change: DecisionEntry, folders: Sequence[AnyPath], settings: DecisionSettings) -> None:
    outcome = judge_change(change, read_flights(folders, settings, BEFORE, BEFORE), settings)
    known = [set(one.flights) for one in read_history(file).outcomes if one.of == change.key]
    # logs that were taken away since take nothing back
    if outcome is not None and not any(set(outcome.flights) < flights for flights in known):
        keep_outcome(file, _rounded(outcome))


def _rounded(entry: Any) -> Any:
    """The entry with figures as all files have them: the same on every machine, and so kept once."""
    return type(entry)(**{name: _plain(value) for name, value in vars(entry).items()})


def _plain(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    if hasattr(value, "__dataclass_fields__"):
        return type(value)(**rounded(vars(value)))
    return rounded(value)


def _told(entry: DecisionEntry, history: History) -> dict[str, Any]:
    outcome = history.outcome_of(entry)
    shown = None if outcome is None else {k: v for k, v in asdict(outcome).items() if k not in ("of", "written")}
    told = ("status", "chosen", "exploratory", "is_loadable", "decided_after", "changes")
    return {name: getattr(entry, name) for name in told} | {
        "previous": {name: entry.before.get(name) for name in entry.changes},
        "predicted": asdict(entry.predicted),
        "outcome": shown,
    }
