"""Does a mission made for it tell the delay of GNSS and the noise of the accelerometer apart better than a survey?

    python -m benchmarks.mission_purpose [--flights 4]

Both are flown by a quadrotor whose velocity errors and accelerometer are as noisy as its parameters say, and white, so
that the likelihood of the innovations of GNSS velocity is that of the right model. Its second derivatives by delay (ms)
and by the logarithm of the noise, the information in the flights, come from a quadratic through replays with five
delays and five noises about the true ones. Printed for each mission: information of a flight and of a minute in the
air, the root of its determinant a minute, the correlation of the two estimates, and the standard errors of both from
one flight.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fusetune.analyze.metrics.likelihood import gaussian_nll
from fusetune.analyze.replaying.prepared_flight import prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.settings import ReplaySettings, WithholdingSettings
from fusetune.design.missions.mission import Mission, load_mission, mission_of
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
from fusetune.execute.simulation import fly
from fusetune.execute.vehicle import GnssError, ReportedAccuracy, Vehicle, Vibration, load_vehicle
from fusetune.execute.world.flight_plan import plan_flight

DELAY, NOISE = "EKF2_GPS_DELAY", "EKF2_ACC_NOISE"
DELAY_MS, NOISE_M_S2, VELOCITY_M_S, POSITION_M = 110.0, 0.35, 0.1, 0.05
"""What is true, and what the filter is told: the noise of an update of 10 ms of 0.035 m/s²/√Hz."""
TOLD = {"EKF2_GPS_V_NOISE": VELOCITY_M_S, "EKF2_GPS_P_NOISE": POSITION_M}
DELAY_STEPS_MS = (-40.0, -20.0, 0.0, 20.0, 40.0)
NOISE_STEPS = (-0.6, -0.3, 0.0, 0.3, 0.6)
"""Of the natural logarithm."""
AXES, GNSS_HZ = 3, 5.0
FIRST_SEED, GROUND_S, SETTLED_S = 700, 30.0, 3.0
_HOME = {"lat": 47.397742, "lon": 8.545594, "alt": 488.0, "geoid_undulation_m": 47.4}


@dataclass(frozen=True)
class Told:
    """What a flight tells.

    Attributes
    ----------
    minutes : in the air
    information : (2, 2) by delay, ms, and by the logarithm of the noise
    """

    minutes: float
    information: np.ndarray

    @property
    def correlation(self) -> float:
        """Of the two estimates."""
        covariance = np.linalg.inv(self.information)
        return float(covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1]))


def missions() -> dict[str, Mission]:
    """The plain survey, and a mission for the two parameters in a field of the same size."""
    survey = load_mission(Path("config/missions/survey.yaml"))
    made = mission_of(
        {
            "name": "for_both",
            "home": _HOME,
            "takeoff": {"altitude_m": survey.takeoff.altitude_m},
            "landing": {"mode": "return", "descent_speed_m_s": survey.landing.descent_speed_m_s},
            "speed_m_s": survey.speed_m_s,
            "purpose": [DELAY, NOISE],
        },
        "for_both",
    )
    both = {"survey": survey, "made for both": made}
    return {name: replace(one, takeoff=replace(one.takeoff, ground_s=GROUND_S)) for name, one in both.items()}


def vehicle_as_told() -> Vehicle:
    """The quadrotor with white errors of the size that the filter is told."""
    vehicle = load_vehicle("config/vehicles/quadrotor.yaml")
    quiet = Vibration(vehicle.imu.vibration.rotor_frequency_hz, 0.0, 0.0, 0.0, 0.0)
    accelerometer = replace(vehicle.imu.accelerometer, noise_density=0.1 * NOISE_M_S2)
    gnss = replace(
        vehicle.gnss,
        delay_ms=DELAY_MS,
        delay_jitter_ms=0.0,
        position=GnssError(POSITION_M, 0.0, 60.0, 1.5),
        velocity=GnssError(VELOCITY_M_S, 0.0, 4.0, 1.5),
        reported=ReportedAccuracy(POSITION_M, 1.5 * POSITION_M, VELOCITY_M_S, 0.0),
    )
    return replace(vehicle, gnss=gnss, imu=replace(vehicle.imu, accelerometer=accelerometer, vibration=quiet))


def told_by(mission: Mission, seed: int) -> Told:
    """Fly a mission and replay it with all pairs of values."""
    vehicle = vehicle_as_told()
    events = plan_flight(mission, vehicle.limits).events
    flight = fly(mission, vehicle, {}, seed, with_estimator=False)
    settings = ReplaySettings(withholding=WithholdingSettings(gnss_s=0.0, baro_s=0.0, mag_s=0.0))
    prepared = prepare_flight(flight, settings)
    rows, likelihoods = [], []
    for late in DELAY_STEPS_MS:
        for step in NOISE_STEPS:
            values = TOLD | {DELAY: DELAY_MS + late, NOISE: NOISE_M_S2 * math.exp(step)}
            replay = replay_set(prepared, "tried", values)
            likelihoods.append(_nll(replay, events.takeoff_s + SETTLED_S, events.touchdown_s))
            rows.append([1.0, late, step, 0.5 * late**2, late * step, 0.5 * step**2])
    quadratic = np.linalg.lstsq(np.array(rows), np.array(likelihoods), rcond=None)[0]
    information = np.array([[quadratic[3], quadratic[4]], [quadratic[4], quadratic[5]]])
    return Told((events.touchdown_s - events.takeoff_s) / 60.0, information)


def _nll(replay: ReplayedSet, start_s: float, stop_s: float) -> float:
    """Negative log-likelihood of the innovations of GNSS velocity in the air, for as many as its rate gives."""
    total = 0.0
    for axis in range(AXES):
        samples = replay.samples["gnss_vel", axis]
        time_s = 1e-6 * samples.timestamp_sample
        flying = (time_s > start_s) & (time_s < stop_s)
        each = gaussian_nll(samples.innovation[flying], samples.innovation_variance[flying])
        # a delay moves a sample into the interval or out of it: the mean, times how many there should be
        total += GNSS_HZ * (stop_s - start_s) * float(each.mean())
    return total


def main() -> None:
    """Fly, replay, and print the table."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    arguments.add_argument("--flights", type=int, default=4)
    options = arguments.parse_args()
    use_kernel_cache()
    print(
        "| mission | minutes | information of delay, 1/ms² | a minute | of ln noise | a minute | √det a minute | "
        "correlation (each) | standard error of delay, ms | of ln noise |"
    )
    print("|---" * 10 + "|")
    for name, mission in missions().items():
        told = [told_by(mission, FIRST_SEED + number) for number in range(options.flights)]
        mean = Told(float(np.mean([one.minutes for one in told])), np.mean([one.information for one in told], axis=0))
        errors = np.sqrt(np.diag(np.linalg.inv(mean.information)))
        delay, noise = np.diag(mean.information)
        each = " ".join(f"{one.correlation:+.2f}" for one in told)
        print(
            f"| {name} | {mean.minutes:.1f} | {delay:.3g} | {delay / mean.minutes:.3g} | {noise:.3g} | "
            f"{noise / mean.minutes:.3g} | {math.sqrt(np.linalg.det(mean.information)) / mean.minutes:.3g} | "
            f"{mean.correlation:+.2f} ({each}) | {errors[0]:.1f} | {errors[1]:.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
