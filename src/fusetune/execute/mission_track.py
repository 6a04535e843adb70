"""The track of a mission as the simulated vehicle flies it: its true motion, without any sensor."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from fusetune.design.covariance.track import Origin, Track
from fusetune.design.missions.mission import Mission
from fusetune.execute.sensors.imu import coning_integral
from fusetune.execute.vehicle import Vehicle
from fusetune.execute.world.earth import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS_M
from fusetune.execute.world.flight_plan import plan_flight
from fusetune.execute.world.truth import Truth, simulate_truth
from fusetune.execute.world.vehicle_state import vehicle_land_detected
from fusetune.px4.flight import TopicTable


def mission_track(mission: Mission, vehicle: Vehicle, seed: int = 1) -> Track:
    """Fly a mission without sensors; `seed` is that of the gusts."""
    plan = plan_flight(mission, vehicle.limits)
    truth = simulate_truth(plan, vehicle, seed)
    landed = vehicle_land_detected(plan, truth)
    home = mission.home
    return track_of(truth, landed, vehicle.imu.rate_hz, Origin(home.lat, home.lon, home.alt), mission.name)


def track_of(truth: Truth, landed: TopicTable, rate_hz: int, origin: Origin, name: str) -> Track:
    """The true motion at the rate of the IMU's samples, with what an ideal IMU would integrate between them.

    Parameters
    ----------
    landed : `vehicle_land_detected` of the flight
    origin : home, the origin of the truth's frame
    """
    per_sample = round(1.0 / (truth.step_s * rate_hz))
    rows = slice(per_sample, None, per_sample)
    samples = (len(truth.timestamp_us) - 1) // per_sample
    shape = (samples, per_sample, 3)
    force = 0.5 * (truth.specific_force[:-1] + truth.specific_force[1:])
    turns = truth.rotation_increments[: samples * per_sample].reshape(shape)
    interval_s = per_sample * truth.step_s
    timestamp_us = truth.timestamp_us[rows]
    lat, lon, height = truth.frame.to_geodetic(truth.position[rows])
    axes = truth.frame.local_axes(lat, lon)
    at_row = np.searchsorted(landed["timestamp"], timestamp_us, side="right") - 1
    north_m, east_m = _metres_per_radian(truth.frame.lat_rad, truth.frame.height_m)
    return Track(
        timestamp_us=timestamp_us,
        attitude=(Rotation.from_matrix(axes).inv() * truth.attitude[rows]).as_quat(canonical=True, scalar_first=True),
        velocity=np.einsum("nij,ni->nj", axes, truth.velocity[rows]),
        position=np.column_stack(
            [
                (lat - truth.frame.lat_rad) * north_m,
                (lon - truth.frame.lon_rad) * east_m,
                truth.frame.height_m - height,
            ]
        ),
        specific_force=force[: samples * per_sample].reshape(shape).mean(axis=1),
        angular_rate=coning_integral(turns) / interval_s,
        in_air=~landed["landed"][at_row].astype(np.bool_),
        at_rest=landed["at_rest"][at_row].astype(np.bool_),
        origin=origin,
        name=name,
    )


def _metres_per_radian(lat_rad: float, height_m: float) -> tuple[float, float]:
    """Metres north and east per radian of latitude and longitude on the ellipsoid WGS-84."""
    shrink = 1.0 - ECCENTRICITY_SQUARED * math.sin(lat_rad) ** 2
    meridian = SEMI_MAJOR_AXIS_M * (1.0 - ECCENTRICITY_SQUARED) / shrink**1.5
    transverse = SEMI_MAJOR_AXIS_M / math.sqrt(shrink)
    return meridian + height_m, (transverse + height_m) * math.cos(lat_rad)
