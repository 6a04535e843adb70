"""The demonstration's vehicle: what its file says of it is so."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from fusetune.design.study import load_study
from fusetune.execute.parameters import flown_parameters
from fusetune.execute.vehicle import load_vehicle

UPDATE_HZ = 100.0
"""EKF2 predicts every 10 ms: white noise of density d has the standard deviation d √rate over that time."""


def test_its_present_parameters_are_wrong_in_three_ways_and_all_else_is_the_quadrotor(project_root: Path) -> None:
    vehicle = load_vehicle(project_root / "config/vehicles/mistuned_quadrotor.yaml")
    study = load_study(project_root / "config/studies/paper_table11.yaml")
    now = flown_parameters(vehicle, study.sets[-1].overrides, default_profile=False).initial
    assert (now["EKF2_GPS_DELAY"], vehicle.gnss.delay_ms) == (110.0, 40.0)
    shakes = vehicle.imu.vibration
    assert shakes.accelerometer_density * UPDATE_HZ**0.5 == pytest.approx(0.8)
    assert now["EKF2_ACC_NOISE"] == 0.35
    assert shakes.gyro_density * UPDATE_HZ**0.5 == pytest.approx(0.06)
    assert now["EKF2_GYR_NOISE"] == 0.015

    calm = load_vehicle(project_root / "config/vehicles/quadrotor.yaml")
    same = dataclasses.replace(
        vehicle,
        name=calm.name,
        description=calm.description,
        gnss=dataclasses.replace(vehicle.gnss, delay_ms=calm.gnss.delay_ms),
        imu=dataclasses.replace(
            vehicle.imu,
            vibration=dataclasses.replace(
                shakes,
                accelerometer_tone=calm.imu.vibration.accelerometer_tone,
                accelerometer_density=calm.imu.vibration.accelerometer_density,
                gyro_density=calm.imu.vibration.gyro_density,
            ),
        ),
    )
    assert same == calm
