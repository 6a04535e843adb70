"""EKF2's √P by design against the spread of the errors of simulated flights: docs/covariance.md.

python -m benchmarks.covariance_check [--flights 50] [--keep FOLDER]

Flies one mission again and again with a vehicle whose sensors are as noisy as EKF2 is told, every time with other
noise and other wind, and compares three things at each GNSS correction, just before it: √P as `fusetune covariance`
computes it along the mission, √P of the flights' own estimators, and the spread of their errors against the truth.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from fusetune.design.covariance.ekf2_covariance import CovarianceAlong
from fusetune.design.covariance.ekf2_design import Ekf2Design, MissionWay, Settings
from fusetune.design.covariance.ekf2_sensors import Ekf2Sensor
from fusetune.design.missions.mission import Mission, load_mission
from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_AXES
from fusetune.ekf2.filter.common.state import PUBLISHED_POSITION
from fusetune.ekf2.numerics.geodesy import lat_lon_difference
from fusetune.ekf2.replay.recording import FLAG_COLUMNS
from fusetune.ekf2.replay.replay import replay
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.execute.mission_track import mission_track
from fusetune.execute.simulation import fly
from fusetune.execute.vehicle import Vehicle, load_vehicle
from fusetune.px4.flight import Flight, TopicTable, stacked
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete

HERE = Path(__file__).parent
MISSION = HERE / "decision_study" / "mission.yaml"
VEHICLE = HERE.parent / "config" / "vehicles" / "default_noise.yaml"
IMU_RATE_HZ = 200
"""Two samples are EKF2's interval of 10 ms then, for which the vehicle's densities are what EKF2 is told."""
FIRST_SEED, DESIGN_SEED = 1000, 999
SETTLE_S = 30.0
RECOVERY_US = 5_000_000
WORLDS = {"consistent": {"EKF2_BARO_CTRL": 0}, "with barometer": {}}
"""What is flown: EKF2 learns the barometer's bias apart from P, so that its height is not consistent."""
HEIGHT_M = 535.0
"""Above the ellipsoid, for metres per degree."""
STATES = ("v_n", "v_e", "v_d", "p_n", "p_e", "p_d", "tilt_n", "tilt_e", "yaw")
GROUPS = {"velocity": (0, 3), "position": (3, 6), "height": (5, 6), "tilt": (6, 8), "yaw": (8, 9), "attitude": (6, 9)}
COVARIANCE = [3, 4, 5, 6, 7, 8, 0, 1, 2]
"""Place of each of `STATES` in the error state."""


def consistent_vehicle() -> Vehicle:
    """The vehicle of default noise, at the interval that its densities are for, without the constant errors of field
    and gyro that no process noise describes."""
    vehicle = load_vehicle(VEHICLE)
    return replace(
        vehicle,
        imu=replace(vehicle.imu, rate_hz=IMU_RATE_HZ),
        magnetometer=replace(vehicle.magnetometer, hard_iron_gauss=0.0),
    )


def errors_of(flight: Flight) -> dict[str, np.ndarray]:
    """At each GNSS correction of the estimator on a flight the errors just before it, (K, 9), their variances by the
    estimator's own P, and the time of the horizon."""
    result = replay(build_inputs(canonical(flight)), complete(flight.parameters.initial, {}, flight.release))
    horizon_us = result.states["timestamp_sample"]
    velocity, position = _rows(result, "gnss_vel"), _rows(result, "gnss_pos")
    sample_us = np.intersect1d(velocity["timestamp_sample"][:, 0], position["timestamp_sample"][:, 0])
    sample_us = sample_us[1:]
    at = np.searchsorted(horizon_us, sample_us)
    now_us, before = horizon_us[at], at - 1
    states, variances = result.states["states"], result.states["covariances"].astype(np.float64)
    truth = _topic(flight, "vehicle_local_position_groundtruth")
    place = _topic(flight, "vehicle_global_position_groundtruth")
    velocity, position = (
        one[np.searchsorted(one["timestamp_sample"][:, 0], sample_us)] for one in (velocity, position)
    )
    error = np.zeros((len(at), 9))
    for axis, name in enumerate(("vx", "vy", "vz")):
        predicted = velocity["observation"][:, axis].astype(np.float64) + velocity["innovation"][:, axis]
        error[:, axis] = predicted - _at(now_us, truth, name)
    error[:, 3:5] = position["innovation"] + _measured_less_true(flight, sample_us, now_us)
    altitude = -states[before, PUBLISHED_POSITION + 2]
    error[:, 5] = _at(horizon_us[before], place, "alt") - altitude
    error[:, 6:] = _attitude_error(flight, horizon_us[before], states[before, :4])
    return {
        "time_us": now_us,
        "error": error,
        "variance": variances[before][:, COVARIANCE],
        "distrusted": _distrusted(result, now_us),
    }


def _distrusted(result: ReplayResult, time_us: np.ndarray) -> np.ndarray:
    """Whether EKF2 takes the vertical acceleration for bad, or did less than `RECOVERY_US` ago, (K,) bool."""
    bad = result.flags["flags"][:, FLAG_COLUMNS.index("fs_bad_acc_vertical")] > 0
    flags_us = result.flags["timestamp"]
    ends_us = np.where(bad, np.append(flags_us[1:], flags_us[-1]) + RECOVERY_US, 0)
    begun = np.searchsorted(flags_us, time_us, side="right") - 1
    return np.maximum.accumulate(ends_us)[begun] > time_us


def _rows(result: ReplayResult, source: str) -> np.ndarray:
    """Innovations of a source, one row per sample and one column per axis."""
    rows = result.innovations[result.source_names() == source]
    return rows.reshape(-1, AID_SOURCE_AXES[source])


def _measured_less_true(flight: Flight, sample_us: np.ndarray, horizon_us: np.ndarray) -> np.ndarray:
    """North and east of the measured position from the true one at the horizon, (K, 2) m."""
    gnss, place = _topic(flight, "vehicle_gps_position"), _topic(flight, "vehicle_global_position_groundtruth")
    delay_us = 1e3 * flight.parameters.initial["EKF2_GPS_DELAY"]
    message = np.abs(gnss["timestamp"][None, :] - delay_us - sample_us[:, None]).argmin(axis=1)
    lat, lon = (_at(horizon_us, place, name) for name in ("lat", "lon"))
    measured = gnss["latitude_deg"][message], gnss["longitude_deg"][message]
    return np.array(
        [
            lat_lon_difference(*np.radians([m_lat, m_lon]), HEIGHT_M, *np.radians([t_lat, t_lon]))
            for m_lat, m_lon, t_lat, t_lon in zip(*measured, lat, lon, strict=True)
        ]
    )


def _attitude_error(flight: Flight, time_us: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Rotation vector from the true to the estimated attitude, north, east, down, (K, 3) rad."""
    truth = _topic(flight, "vehicle_attitude_groundtruth")
    logged = stacked(truth, "q")
    signs = np.cumprod(np.where(np.sum(logged[1:] * logged[:-1], axis=1) < 0.0, -1.0, 1.0))
    logged[1:] *= signs[:, None]
    true = np.column_stack([np.interp(time_us, truth["timestamp"], part) for part in logged.T])
    turned = Rotation.from_quat(quaternion, scalar_first=True) * Rotation.from_quat(true, scalar_first=True).inv()
    return np.asarray(turned.as_rotvec())


def _topic(flight: Flight, name: str) -> TopicTable:
    table = flight.topic(name)
    assert table is not None, name
    return table


def _at(time_us: np.ndarray, table: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    return np.interp(time_us, table["timestamp"], table[name].astype(np.float64))


@dataclass(frozen=True)
class Compared:
    """Flights of a world beside the design.

    Attributes
    ----------
    designed : (K, 9, 9) covariance by the design at K instants
    errors : (F, K, 9) of the flights at their corrections nearest to these instants
    own : (F, K, 9) variances by the flights' own estimators
    trusted : (F, K) where EKF2 trusts its accelerometer
    """

    designed: np.ndarray
    errors: np.ndarray
    own: np.ndarray
    trusted: np.ndarray

    def lines(self) -> Iterator[str]:
        """As a table of Markdown."""
        yield "| states | √P by design | √P of the flights | spread of the errors | spread / design | NEES / states |"
        yield "|---|---|---|---|---|---|"
        kept = self.trusted[..., None]
        for name, (first, last) in GROUPS.items():
            part = slice(first, last)
            factor, unit = (np.degrees(1.0), "°") if first >= 6 else (1.0, "m" if first >= 3 else "m/s")
            designed = np.sqrt(np.trace(self.designed[:, part, part], axis1=1, axis2=2).mean())
            own, spread = (
                float(np.sqrt(np.sum(np.where(kept, one, 0.0)[..., part]) / self.trusted.sum()))
                for one in (self.own, self.errors**2)
            )
            inverse = np.linalg.inv(self.designed[:, part, part])
            nees = np.einsum("fki,kij,fkj->fk", self.errors[..., part], inverse, self.errors[..., part])
            yield (
                f"| {name} | {factor * designed:.4f} {unit} | {factor * own:.4f} {unit} | {factor * spread:.4f} {unit} "
                f"| {spread / designed:.3f} | {nees[self.trusted].mean() / (last - first):.3f} |"
            )


def compared(flights: Sequence[Mapping[str, np.ndarray]], along: CovarianceAlong) -> Compared:
    """Put flights of one mission beside its design."""
    errors, own, trusted = [], [], []
    for flight in flights:
        row = np.abs(flight["time_us"][None, :] - along.horizon_us[:, None]).argmin(axis=1)
        errors.append(flight["error"][row])
        own.append(flight["variance"][row])
        trusted.append(~flight["distrusted"][row])
    designed = along.before[:, COVARIANCE][:, :, COVARIANCE]
    return Compared(designed, np.array(errors), np.array(own), np.array(trusted))


def designed_along(vehicle: Vehicle, mission: Mission, with_barometer: bool) -> CovarianceAlong:
    """The covariances of the mission from P alone, with what EKF2 is told of the vehicle."""
    gnss, magnetometer, barometer = vehicle.gnss, vehicle.magnetometer, vehicle.barometer
    sensors = {
        "gnss": Ekf2Sensor(gnss.rate_hz, gnss.delay_ms),
        "mag": Ekf2Sensor(magnetometer.rate_hz),
        "baro": Ekf2Sensor(barometer.rate_hz, used=with_barometer),
    }
    track = mission_track(mission, vehicle, DESIGN_SEED)
    way = MissionWay(str(MISSION), str(VEHICLE), DESIGN_SEED)
    design = Ekf2Design(HERE, "check", Settings(sensors, vehicle.parameters), way, settle_s=SETTLE_S, track=track)
    return design.along(design.settings)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=50)
    parser.add_argument("--keep", type=Path, default=Path("benchmarks/results/covariance_check"))
    options = parser.parse_args()
    mission, vehicle = load_mission(MISSION), consistent_vehicle()
    for world, parameters in WORLDS.items():
        folder = options.keep / world.replace(" ", "_")
        folder.mkdir(parents=True, exist_ok=True)
        flights = []
        for number in range(options.flights):
            file = folder / f"flight_{number:02d}.npz"
            if not file.exists():
                flight = fly(mission, vehicle, parameters, FIRST_SEED + number, with_estimator=False)
                np.savez(file, **errors_of(flight))
            with np.load(file) as kept:
                flights.append(dict(kept))
        table = compared(flights, designed_along(vehicle, mission, not parameters))
        instants, distrusted = table.trusted.shape[1], 1.0 - table.trusted.mean()
        hit = int((~table.trusted).any(axis=1).sum())
        print(f"\n{world}: {len(flights)} flights, {instants} corrections of each; in {hit} flights EKF2 distrusts its")
        print(f"accelerometer at times ({100 * distrusted:.1f} % of the corrections, which are left out)\n")
        print(*table.lines(), sep="\n")


if __name__ == "__main__":
    main()
