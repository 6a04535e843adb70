"""Small studies made for tests: several flights scored, with their table of flights."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
from tests.analyze.made_flight import MadeSet, make_flight

from fusetune.analyze.scoring.score_flight import score_saved_flight
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.storage.parquet import write_table


def make_study(
    root: Path,
    sets: dict[str, MadeSet],
    flights: int = 6,
    *,
    refused: tuple[str, ...] = (),
    landing_s: float = 70.0,
    vehicles: Sequence[VehicleIdentity] = (),
) -> tuple[list[Path], Path]:
    """Make, score and list flights; of the first ones it is told which vehicle flew, the others say nothing.

    Returns
    -------
    Analyze folders and the table of flights
    """
    folders, rows = [], []
    for index in range(flights):
        name = f"flight_{index}"
        save, folder = make_flight(root, name, sets, seed=100 + index, landing_s=landing_s, truth=index == 0)
        score_saved_flight(save, folder, list(sets))
        folders.append(folder)
        rows.append(
            {"flight": name, "status": "replayable", "reason": "", "firmware": "v1.16.0", "checksum": "ab" * 32}
        )
    for name in refused:
        rows.append(
            {
                "flight": name,
                "status": "refused",
                "reason": "IMU at 20 Hz",
                "firmware": "v1.12.3",
                "checksum": "cd" * 32,
            }
        )
    for row in rows:
        row |= {"duration_s": 75.0, "airborne_s": 60.0} | VehicleIdentity().columns()
    for row, vehicle in zip(rows, vehicles, strict=False):
        row |= vehicle.columns()
    table = root / "flights.parquet"
    columns = ("flight", "status", "reason", "firmware", "checksum", "duration_s", "airborne_s")
    types = dict.fromkeys(columns[:5], pa.string()) | dict.fromkeys(columns[5:], pa.float64())
    types |= dict.fromkeys(VehicleIdentity().columns(), pa.string())
    write_table(pa.Table.from_pylist(rows, schema=pa.schema(list(types.items()))), table)
    return folders, table
