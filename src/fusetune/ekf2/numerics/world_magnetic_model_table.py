"""The grids of the world magnetic model that `world_magnetic_model` interpolates, and how they were made.

PX4 v1.16 carries WMM2020 at epoch 2024.41257 on a grid of 10°, each quantity stored in 16 bits with the scale that just
fits its largest value; releases before it carry it at dates of their own, in 10⁻⁴ rad and 10⁻⁴ Gauss.
`python -m fusetune.ekf2.numerics.world_magnetic_model_table` computes the same grids from the published WMM2020
coefficients (package pygeomag, height 0 on the ellipsoid) and writes `world_magnetic_model.csv` and, of an older
release, `world_magnetic_model_v1.15.csv` … beside this file. The tests compare them with what PX4's own estimators
report. Of PX4's older tables a dozen values that lie halfway between two integers, and some at the poles, where east
and west lose their meaning, are the other integer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fusetune.storage.files import AnyPath, atomic_path

EPOCH_YEAR = 2024.41257
OLDER_EPOCHS = {"v1.13": 2022.2767, "v1.14": 2023.3287, "v1.15": 2024.0684}
"""Dates of the tables of the releases before v1.16."""

COEFFICIENTS = "wmm/WMM_2020.COF"
LARGEST_INTEGER = 32767
RESOLUTION_DEG = 10
LATITUDES_DEG = np.arange(-90, 91, RESOLUTION_DEG)
LONGITUDES_DEG = np.arange(-180, 181, RESOLUTION_DEG)
QUANTITIES = ("declination", "inclination", "strength")

TABLE_PATH = Path(__file__).with_name("world_magnetic_model.csv")

_TEN_THOUSANDTH_OF_A_RADIAN = math.degrees(1e-4)
OLDER_SCALES = dict(zip(QUANTITIES, (_TEN_THOUSANDTH_OF_A_RADIAN, _TEN_THOUSANDTH_OF_A_RADIAN, 10.0), strict=True))
"""Degrees, degrees and nT per unit of an older table."""


class MagneticTable(NamedTuple):
    """One quantity on the grid.

    `values` has shape (19, 37), latitudes from south to north, longitudes from -180° to 180°; value times `scale` is
    degrees for the angles and nT for the strength.
    """

    scale: float
    values: np.ndarray


def older_table_path(release: str) -> Path:
    """Where the tables of a release before v1.16 are."""
    return TABLE_PATH.with_name(f"world_magnetic_model_{release}.csv")


def compute_tables(
    decimal_year: float = EPOCH_YEAR, scales: Mapping[str, float] | None = None
) -> dict[str, MagneticTable]:
    """Evaluate the model on the grid and store it in 16 bits, in units of `scales` or of what fits best."""
    from pygeomag import GeoMag

    model = GeoMag(coefficients_file=COEFFICIENTS)
    grid = np.empty((3, LATITUDES_DEG.size, LONGITUDES_DEG.size))
    for i, latitude in enumerate(LATITUDES_DEG):
        for j, longitude in enumerate(LONGITUDES_DEG):
            field = model.calculate(glat=float(latitude), glon=float(longitude), alt=0.0, time=decimal_year)
            grid[:, i, j] = field.d, field.i, field.f
    tables = {}
    for quantity, values in zip(QUANTITIES, grid, strict=True):
        scale = scales[quantity] if scales else float(f"{np.abs(values).max() / LARGEST_INTEGER:.9g}")
        tables[quantity] = MagneticTable(scale, np.rint(values / scale))
    return tables


def write_tables(tables: dict[str, MagneticTable], path: AnyPath = TABLE_PATH) -> None:
    """Write the tables as text: one row per quantity and latitude."""
    path = Path(path)
    header = ["quantity", "scale", "latitude_deg", *(str(longitude) for longitude in LONGITUDES_DEG)]
    lines = [",".join(header)]
    for quantity, table in tables.items():
        for latitude, row in zip(LATITUDES_DEG, table.values, strict=True):
            lines.append(",".join([quantity, repr(table.scale), str(latitude), *(str(int(value)) for value in row)]))
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="ascii")


def read_tables(path: AnyPath = TABLE_PATH) -> dict[str, MagneticTable]:
    """Read what `write_tables` wrote."""
    path = Path(path)
    rows = [line.split(",") for line in path.read_text(encoding="ascii").splitlines()[1:]]
    tables = {}
    for quantity in QUANTITIES:
        of_quantity = [row for row in rows if row[0] == quantity]
        values = np.array([[float(value) for value in row[3:]] for row in of_quantity])
        tables[quantity] = MagneticTable(float(of_quantity[0][1]), values)
    return tables


if __name__ == "__main__":
    write_tables(compute_tables())
    for older, year in OLDER_EPOCHS.items():
        write_tables(compute_tables(year, OLDER_SCALES), older_table_path(older))
