"""What a state that the vehicle logged is in the memory of releases until v1.15.

Up to v1.15 position is local, up to v1.14 attitude errors are those of the quaternion and biases increments; the logged
state is told as v1.16's.
"""

from __future__ import annotations

import math

import numpy as np

from fusetune.ekf2.feed.inputs import EstimatorInputs
from fusetune.ekf2.filter.aid_sources.gnss.gnss_arrival import DEGREE_PARTS, MIN_FIX_TYPE
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_3d_control import RESETS_AFTER_START
from fusetune.ekf2.filter.common.state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, MAG_BODY, MAG_EARTH, TERRAIN
from fusetune.ekf2.filter.world_field import earth_field_vector
from fusetune.ekf2.numerics.geodesy import earth_rate_ned, project
from fusetune.ekf2.numerics.world_magnetic_model import field_at
from fusetune.px4.layouts.logged_state import LoggedState

PLACE = ("lat_deg", "lon_deg")
NEAR_US = 1_000_000
"""Samples that are so near to the buffered ones are placed along with them; what arrives is placed then anew."""

QUATERNION = (ATTITUDE, ATTITUDE + 1, ATTITUDE + 2, TERRAIN)
"""Places of the quaternion's elements in the error state."""


def is_local(e: np.void) -> bool:
    """Whether the release keeps its position local."""
    return "local" in (e.dtype.names or ())


def put_local_position(e: np.void, position: np.ndarray) -> None:
    """Put the vehicle at a place (m, NED) of the local frame, where the release has one; the Earth turns as there."""
    if not is_local(e):
        return
    local = e["local"]
    local["north"] = local["last_known_north"] = float(np.float32(position[0]))
    local["east"] = local["last_known_east"] = float(np.float32(position[1]))
    e["gpos_lat"] = e["gpos_lon"] = e["last_known_lat"] = e["last_known_lon"] = 0.0
    e["gpos_alt"] = e["last_known_alt"] = float(np.float32(-position[2]))
    if e["origin"]["lat_lon_valid"]:
        e["earth_rate_ned"] = earth_rate_ned.py_func(float(e["origin"]["lat_rad"]))


def place_of(e: np.void) -> tuple[float, float]:
    """Latitude and longitude (deg) of the vehicle, of releases with a local position those of the origin."""
    lat, lon = (e["origin"]["lat_rad"], e["origin"]["lon_rad"]) if is_local(e) else (e["gpos_lat"], e["gpos_lon"])
    return math.degrees(lat), math.degrees(lon)


def position_of_output(e: np.void) -> np.ndarray:
    """The filter's position (m, NED) as the output predictor counts it: of the origin, or of where it is now."""
    if not is_local(e):
        return np.zeros(3)
    return np.array([e["local"]["north"], e["local"]["east"], -e["gpos_alt"]])


def bias_unit(e: np.void) -> float:
    """What a bias of 1 rad/s, or 1 m/s², is in the unit of the record's."""
    return float(e["quaternion"]["mean_dt"]) if "quaternion" in (e.dtype.names or ()) else 1.0


def settle_samples(e: np.void, inputs: EstimatorInputs) -> None:
    """Place GNSS samples that wait where releases do so on arrival; v1.13 knows the barometer by its offset alone."""
    names = e.dtype.names or ()
    if "gnss_arrivals" in names and e["origin"]["lat_lon_valid"]:
        positions, gnss = e["gnss_arrivals"]["positions"], inputs.arrays.gnss
        since, until = int(e["time_delayed_us"]) - NEAR_US, int(e["time_latest_us"]) + NEAR_US
        for slot in np.flatnonzero((gnss["time_us"] >= since) & (gnss["time_us"] <= until)):
            lat, lon = (math.radians(round(float(gnss[name][slot]) * DEGREE_PARTS) / DEGREE_PARTS) for name in PLACE)
            origin = float(e["origin"]["lat_rad"]), float(e["origin"]["lon_rad"])
            fixed = gnss["fix_type"][slot] >= MIN_FIX_TYPE
            positions[slot % len(positions)] = project.py_func(*origin, lat, lon) if fixed else 0.0
    if "heights" in names:
        e["baro"]["lpf"] = e["baro_b_est"]["bias"]


def settle_field(e: np.void, release: str, state: LoggedState, *, is_known: bool) -> None:
    """What releases until v1.15 remember of the field: the model's at the origin, and how it is fused.

    Until v1.14 the heading is measured less the body field, whether that is estimated or not.

    Parameters
    ----------
    is_known : whether the vehicle estimated the field, which `state` then tells with its variances
    """
    names, mag, now = e.dtype.names or (), e["mag"], int(e["time_delayed_us"])
    if "field_history" not in names:
        return
    if e["origin"]["lat_lon_valid"]:
        field = field_at(*place_of(e), release)
        mag["wmm_declination"], mag["wmm_inclination"], mag["wmm_strength"] = field
        earth_field_vector.py_func(*field, mag["wmm_earth_field"])
        mag["wmm_time_last_checked"] = now
        # older than any fusion, so that it resets nothing
        e["field_history"]["wmm_time_last_set"] = 1
    e["field_history"]["declination_fused"] = is_known
    e["field_history"]["resets_available"] = RESETS_AFTER_START
    if "mag_modes" not in names:
        return
    e["cs"]["mag"] = e["cs_prev"]["mag"] = False
    if np.any(state.mag_earth):
        e["mag_I"], e["mag_B"] = state.mag_earth, state.mag_body
    else:
        e["mag_I"] = e["R_to_earth"] @ mag["lpf"]
    e["mag_modes"]["time_last_used"] = now
    if "mag_3d" in state.flags:
        e["mag_modes"]["time_last_suitable"] = now


def settle_core(e: np.void, params: np.void) -> None:
    """Take terrain, biases, field and attitude out of v1.16's error state where the release has them elsewhere.

    Call it when state, variances and flags are set; without correlations, `P` is diagonal.
    """
    names, P = e.dtype.names or (), e["P"]
    if "terrain_filter" in names:
        P[TERRAIN, TERRAIN] = 0.0
        e["terrain_filter"]["variance"] = params["EKF2_MIN_RNG"] ** 2
    if "quaternion" not in names:
        return
    core, modes = e["quaternion"], e["mag_modes"]
    core["mean_dt"] = unit = float(e["dt_ekf_avg"])
    for name, first in (("gyro_bias", GYRO_BIAS), ("accel_bias", ACCEL_BIAS)):
        rows = np.arange(first, first + 3)
        e[name] *= unit
        P[rows, rows] *= unit * unit
        core[f"kept_{name}_var"] = P[rows, rows]
    modes["saved_body_variance"] = np.diag(P)[MAG_BODY : MAG_BODY + 3]
    modes["saved_horizontal_covariance"] = P[MAG_EARTH : MAG_EARTH + 2, MAG_EARTH : MAG_EARTH + 2]
    modes["saved_down_variance"] = P[MAG_EARTH + 2, MAG_EARTH + 2]
    P[MAG_EARTH : MAG_BODY + 3] = 0.0
    turns = 0.5 * turns_of(e["q"])
    attitude = turns @ np.diag(np.diag(P)[ATTITUDE : ATTITUDE + 3]) @ turns.T
    P[np.ix_(QUATERNION, QUATERNION)] = attitude


def turns_of(q: np.ndarray) -> np.ndarray:
    """(0, eᵢ) ⊗ q for north, east and down, the columns of a (4, 3) matrix: twice what an attitude error adds to q."""
    w, x, y, z = q
    return np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])
