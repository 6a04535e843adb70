"""Replay parameter sets on one flight: saved as Parquet, or straight from a log."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from fusetune.analyze.flight_phases import airborne_intervals
from fusetune.analyze.replay_files import ReplayIdentity, write_replay
from fusetune.analyze.withheld_gaps import WithholdingSettings, plan_gaps
from fusetune.ekf2.inputs import build_inputs
from fusetune.ekf2.parameters import complete
from fusetune.ekf2.replay import replay
from fusetune.errors import UserError
from fusetune.px4.flight import Flight
from fusetune.px4.release_layouts import ESTIMATOR_TOPICS, canonical
from fusetune.save.flight_folder import load_flight

WRITTEN_BACK = "EKF2_MAG_DECL"


def replay_saved_flight(
    flight_folder: Path,
    sets: Mapping[str, Mapping[str, float]],
    output_folder: Path,
    withholding: WithholdingSettings | None = None,
) -> None:
    """Replay sets on a saved flight.

    Parameters
    ----------
    flight_folder : Path
        `results/save/<flight>`.
    sets : mapping
        Name of each set → its overrides of the log's own parameters.
    output_folder : Path
        Takes the files of `fusetune.analyze.replay_files` for each set.
    withholding : WithholdingSettings, optional
        Gaps to be made in the sensors; the default ones if None.
    """
    replay_flight(load_flight(flight_folder, topics=ESTIMATOR_TOPICS), sets, output_folder, withholding)


def replay_flight(
    flight: Flight,
    sets: Mapping[str, Mapping[str, float]],
    output_folder: Path,
    withholding: WithholdingSettings | None = None,
) -> None:
    """Replay sets on a flight in memory; each set gives overrides of the log's own parameters."""
    flight = canonical(flight)
    inputs = build_inputs(flight)
    gaps = plan_gaps(flight, airborne_intervals(flight, {}), withholding or WithholdingSettings())
    for name, overrides in sets.items():
        params = complete(flight.parameters.initial, overrides, flight.release)
        result = replay(inputs, params, overridden=frozenset(overrides), gaps=gaps)
        write_replay(output_folder, ReplayIdentity(name, overrides, params), result)


def replay_log(log: Path, sets_folder: Path, output_folder: Path) -> list[str]:
    """Replay every set that a folder holds as `SET.json` on one ULog file.

    `params` of each JSON file are the EKF2 parameters used, `overrides` those that differ from the log.

    Returns
    -------
    list of str
        Names of the sets replayed.

    Raises
    ------
    UserError
        The log cannot be read, or a set file is not usable.
    """
    from fusetune.px4.ulog_reader import read_ulog

    set_files = sorted(sets_folder.glob("*.json"))
    if not set_files:
        raise UserError(sets_folder, "holds no parameter set", "Put one SET.json with a params object per set there")
    flight = read_ulog(log)
    inputs = build_inputs(canonical(flight))
    for file in set_files:
        params, overrides = _read_set(file)
        # The estimator writes this one back once it knows its place, so a recorded set holds the value at the end.
        params.pop(WRITTEN_BACK, None)
        values = complete(flight.parameters.initial, params | overrides, flight.release)
        result = replay(inputs, values, overridden=frozenset(overrides))
        write_replay(output_folder, ReplayIdentity(file.stem, overrides, values), result)
    return [file.stem for file in set_files]


def _read_set(file: Path) -> tuple[dict[str, float], dict[str, float]]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        params, overrides = content.get("params", {}), content.get("overrides", {})
        return {k: float(v) for k, v in params.items()}, {k: float(v) for k, v in overrides.items()}
    except (ValueError, AttributeError, TypeError) as error:
        remedy = 'Expected {"params": {NAME: number, …}, "overrides": {NAME: number, …}}'
        raise UserError(file, f"is not a parameter set: {error}", remedy) from error
