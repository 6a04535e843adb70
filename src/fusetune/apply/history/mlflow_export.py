"""Histories as MLflow has experiments: a vehicle is an experiment, a decision a run, each set that was compared a run
below it.

MLflow is an extra (`pip install fusetune[mlflow]`): its SQLite store is read by its own UI and by whatever people have
for it, and nothing here needs it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from fusetune.apply.history.entries import DecisionEntry, Gain, History, OutcomeEntry
from fusetune.apply.history.words import changes_words, outcome_words
from fusetune.errors import UserError
from fusetune.storage.files import AnyPath

DATABASE, ARTIFACTS = "mlflow.db", "artifacts"
_KEY, _OUTCOME = "fusetune.decision", "fusetune.outcome"
_PARENT, _NOTE = "mlflow.parentRunId", "mlflow.note.content"


def store_of(folder: AnyPath) -> str:
    """Where the store of a folder is, as MLflow is told it."""
    return f"sqlite:///{Path(folder).resolve() / DATABASE}"


def export_histories(histories: Iterable[History], folder: AnyPath) -> int:
    """Add what a store lacks of some histories; returns how many runs were added.

    Raises
    ------
    UserError
        MLflow is not installed.
    """
    client = _client(folder)
    return sum(_export(client, history, Path(folder)) for history in histories if history.decisions)


def _client(folder: AnyPath) -> Any:
    try:
        from mlflow import MlflowClient
    except ImportError as error:
        raise UserError(
            "MLflow", "is not installed", "Install the extra: pip install --require-hashes -r requirements-mlflow.lock"
        ) from error
    Path(folder).mkdir(parents=True, exist_ok=True)
    return MlflowClient(tracking_uri=store_of(folder), registry_uri=store_of(folder))


def _export(client: Any, history: History, folder: Path) -> int:
    name = history.decisions[-1].vehicle.name
    experiment = client.get_experiment_by_name(name)
    artifacts = (folder.resolve() / ARTIFACTS).as_uri()
    known = experiment.experiment_id if experiment else client.create_experiment(name, artifact_location=artifacts)
    return sum(_export_decision(client, known, entry, history.outcome_of(entry)) for entry in history.decisions)


def _export_decision(client: Any, experiment: str, entry: DecisionEntry, outcome: OutcomeEntry | None) -> int:
    found = client.search_runs([experiment], filter_string=f"tags.`{_KEY}` = '{entry.key}'", max_results=1)
    added = 0
    if found:
        decision = found[0].info.run_id
    else:
        decision = _run(client, experiment, f"{entry.status}: {entry.chosen}", entry.written, _decision_tags(entry))
        _log(client, decision, dict(entry.changes), _gain_metrics("predicted", entry.predicted))
        client.set_terminated(decision, end_time=_milliseconds(entry.written))
        added = 1 + _export_sets(client, experiment, decision, entry)
    told = "" if outcome is None else f"{outcome.written} {outcome.status}"
    if outcome is not None and (not found or found[0].data.tags.get(_OUTCOME) != told):
        figures = _gain_metrics("measured", outcome.paired) | _gain_metrics("on_board", outcome.unpaired)
        _log(client, decision, {}, figures)
        client.set_tag(decision, _OUTCOME, told)
        client.set_tag(decision, "outcome", outcome_words(outcome))
    return added


def _export_sets(client: Any, experiment: str, decision: str, entry: DecisionEntry) -> int:
    for one in entry.sets:
        tags = {_PARENT: decision, "status": one["status"], "vehicle": entry.vehicle.name}
        run = _run(client, experiment, one["name"], entry.written, tags)
        figures = {name: one[name] for name in ("score", "p_family", "flights", "flights_better")}
        gain = _gain_metrics("gain", Gain(**one["gain"])) if one["gain"] is not None else {}
        _log(client, run, one["overrides"], figures | gain)
        client.set_terminated(run, end_time=_milliseconds(entry.written))
    return len(entry.sets)


def _decision_tags(entry: DecisionEntry) -> dict[str, str]:
    tags = {
        _KEY: entry.key,
        "vehicle": entry.vehicle.name,
        "product": entry.product,
        "exploratory": str(entry.exploratory),
        "decided_after": entry.decided_after,
        _NOTE: changes_words(entry.changes, entry.before) or "what flew was kept",
    }
    return tags | {f"study.{name}": digest for name, digest in entry.study.items()}


def _run(client: Any, experiment: str, name: str, written: str, tags: Mapping[str, str]) -> str:
    run = client.create_run(experiment, start_time=_milliseconds(written), tags=dict(tags), run_name=name)
    return str(run.info.run_id)


def _log(client: Any, run: str, parameters: Mapping[str, float], figures: Mapping[str, float | None]) -> None:
    from mlflow.entities import Metric, Param

    now = _milliseconds(None)
    known = [Metric(name, float(value), now, 0) for name, value in figures.items() if value is not None]
    client.log_batch(run, metrics=known, params=[Param(name, f"{value:.9g}") for name, value in parameters.items()])


def _gain_metrics(name: str, gain: Gain) -> dict[str, float | None]:
    return {
        f"{name}_percent": gain.percent,
        f"{name}_lower_percent": gain.lower,
        f"{name}_upper_percent": gain.upper,
        f"{name}_flights": gain.flights,
    }


def _milliseconds(written: str | None) -> int:
    moment = datetime.now(UTC) if written is None else datetime.strptime(written, "%Y-%m-%dT%H:%M:%SZ")
    return round(moment.replace(tzinfo=UTC).timestamp() * 1e3)
