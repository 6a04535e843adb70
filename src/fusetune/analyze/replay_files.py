"""Files that hold one replay: `<set>.innovations.parquet`, `.states`, `.local_position`, `.status_flags`, `.json`.

Beside them `.withheld` and `.gaps` hold what the filter predicted while a sensor was withheld from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from fusetune.analyze.withheld_gaps import gap_table, prediction_table
from fusetune.documents import write_document
from fusetune.ekf2.replay import ReplayResult
from fusetune.ekf2.replay_tables import flags_table, innovation_table, local_position_table, state_table
from fusetune.files import AnyPath, atomic_path
from fusetune.parquet import write_table

TABLES = {
    "innovations": innovation_table,
    "states": state_table,
    "local_position": local_position_table,
    "status_flags": flags_table,
    "withheld": lambda result: prediction_table(result.gaps),
    "gaps": lambda result: gap_table(result.gaps),
}

BASELINE = "v1.16"


@dataclass(frozen=True)
class ReplayIdentity:
    """What was replayed."""

    set: str
    overrides: Mapping[str, float]
    params: Mapping[str, float]
    inputs: Mapping[str, Any] | None = None
    """How the replay started and what was reconstructed for it; stands in the JSON file."""


def replay_files(folder: AnyPath, set_name: str) -> list[Path]:
    """All files of one replay."""
    folder = Path(folder)
    return [folder / f"{set_name}.{table}.parquet" for table in TABLES] + [folder / f"{set_name}.json"]


def write_replay(
    folder: AnyPath, identity: ReplayIdentity, result: ReplayResult, measured: np.ndarray | None = None
) -> None:
    """Write the tables of a replay, and last the JSON that says the set is complete.

    Parameters
    ----------
    measured : for each innovation row whether its measurement stands in the log; None: all of them. The column
        `measured` is written only where some do not.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, to_table in TABLES.items():
        table = to_table(result)
        if name == "innovations" and measured is not None and not measured.all():
            table = table.append_column("measured", pa.array(measured))
        write_replay_table(table, folder / f"{identity.set}.{name}.parquet")
    with atomic_path(folder / f"{identity.set}.json") as path:
        write_document(path, _summary(identity, result))


def write_replay_table(table: pa.Table, target: AnyPath) -> None:
    """Write a Parquet file that is either whole or not there."""
    with atomic_path(target) as path:
        # Figures hardly ever repeat: a dictionary of them, and their extremes, would only take time.
        texts = [field.name for field in table.schema if pa.types.is_dictionary(field.type)]
        write_table(table, path, compression="zstd", compression_level=1, use_dictionary=texts, write_statistics=False)


def _summary(identity: ReplayIdentity, result: ReplayResult) -> dict[str, object]:
    status, reason = ("diverged", "a state or variance is no finite number") if result.diverged else ("ok", "")
    if not result.updates:
        status, reason = "not_started", "the filter never found the vehicle still enough to take its tilt"
    origin = None
    if result.origin is not None:
        origin = dict(zip(("latitude_deg", "longitude_deg", "altitude_m"), result.origin, strict=True))
    return {
        "version": BASELINE,
        "set": identity.set,
        "overrides": dict(identity.overrides),
        "status": status,
        "reason": reason,
        "n_imu": result.imu_samples,
        "n_updates": result.updates,
        "mode": result.mode,
        **(identity.inputs or {}),
        "resets": result.resets,
        "filter_fault_flags_max": result.filter_fault_flags_max,
        "origin": origin,
        "params": dict(identity.params),
    }
