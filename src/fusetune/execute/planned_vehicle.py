"""A vehicle file as missions are planned for it."""

from __future__ import annotations

import os

from fusetune.design.missions.outlook import PlannedVehicle
from fusetune.execute.vehicle import load_vehicle


def planned_vehicle(file: str | os.PathLike[str] | None) -> PlannedVehicle:
    """Limits, endurance and drag of a vehicle; without a file those of PX4's defaults.

    Raises
    ------
    UserError
        As of `load_vehicle`.
    """
    if file is None:
        return PlannedVehicle()
    vehicle = load_vehicle(file)
    return PlannedVehicle(vehicle.name, vehicle.limits, vehicle.endurance, vehicle.drag)
