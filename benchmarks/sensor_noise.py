"""Noise figures of sensors against the truth: Allan figures of made noise, starting parameters of simulated flights.

    python -m benchmarks.sensor_noise [--draws 150] [--flights 5]

Made noise is white noise, flicker noise or a Gauss–Markov process, and a random walk of known size. Flights are those
of `config/vehicles`, whose noise at rest and in flight stands there.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.sensor_noise.allan import KINDS, allan_curve
from fusetune.analyze.sensor_noise.allan_fit import NoiseFigure, allan_figures
from fusetune.analyze.sensor_noise.sensor_noise import sensor_noise
from fusetune.design.missions.mission import load_mission
from fusetune.execute.noise import gauss_markov, random_walk, white_noise
from fusetune.execute.simulation import fly
from fusetune.execute.vehicle import load_vehicle
from fusetune.px4.layouts.release_layouts import canonical

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Case:
    """Made noise: three axes of `length_s` at `rate_hz` with the three figures; `several` stretches of it."""

    words: str
    length_s: float
    rate_hz: float
    white: float
    flicker: float = 0.0
    walk: float = 0.0
    several: int = 1
    gauss_markov: bool = False

    @property
    def truth(self) -> dict[str, float]:
        return {"white": self.white, "flicker": self.flicker, "walk": self.walk}


CASES = (
    Case("before arming", 30.0, 200.0, 1.0, 0.05, 0.001),
    Case("twelve flights", 30.0, 200.0, 1.0, 0.05, 0.001, several=12),
    Case("ten minutes", 600.0, 100.0, 1.0, 0.1, 0.003),
    Case("an hour, flicker", 3600.0, 20.0, 0.3, 0.1),
    Case("an hour, walk", 3600.0, 20.0, 1.0, 0.0, 0.05),
    Case("an hour, all", 3600.0, 20.0, 0.2, 0.1, 0.01),
    Case("an hour, Gauss-Markov", 3600.0, 20.0, 0.3, 0.1, gauss_markov=True),
    Case("an hour, Gauss-Markov, walk", 3600.0, 20.0, 0.2, 0.1, 0.01, gauss_markov=True),
)


def flicker_noise(rng: np.random.Generator, samples: int, axes: int, step_s: float, instability: float) -> np.ndarray:
    """Noise of one-sided density B² / (π f), (samples, axes), whose Allan variance is (2 ln 2 / π) B².

    A part of a record four times as long, so that it does not close into itself.
    """
    length = 4 * samples
    frequency = np.fft.rfftfreq(length, step_s)
    size = np.zeros(len(frequency))
    size[1:] = np.sqrt(instability**2 / (math.pi * frequency[1:]) * length / (4.0 * step_s))
    draws = rng.standard_normal((2, len(frequency), axes))
    return np.fft.irfft(size[:, None] * (draws[0] + 1j * draws[1]), length, axis=0)[:samples]


def made_noise(rng: np.random.Generator, case: Case) -> np.ndarray:
    """One stretch, (samples, 3)."""
    samples, step_s = round(case.length_s * case.rate_hz), 1.0 / case.rate_hz
    values = white_noise(rng, samples, 3, step_s, case.white)
    if case.gauss_markov:
        # its Allan deviation is at most 0.618 σ (IEEE Std 952-1997, annex C): there it is to be as of flicker noise
        deviation = case.flicker * 0.664 / 0.618
        values += gauss_markov(rng, samples, 3, step_s, deviation, 30.0)
    elif case.flicker:
        values += flicker_noise(rng, samples, 3, step_s, case.flicker)
    if case.walk:
        values += random_walk(rng, samples, 3, step_s, case.walk)
    return values


def figures_of(case: Case, seeds: Sequence[int]) -> dict[str, list[NoiseFigure]]:
    """The three figures of each draw, by kind of noise."""
    found: dict[str, list[NoiseFigure]] = {kind: [] for kind in KINDS}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        stretches = [made_noise(rng, case) for _ in range(case.several)]
        figures = allan_figures(allan_curve(stretches, 1.0 / case.rate_hz))
        for kind in KINDS:
            found[kind].append(figures.of(kind))
    return found


@dataclass(frozen=True)
class Outcome:
    """How one figure did over draws: shares, and the median of the relative error where it was told."""

    told: float
    median_error: float
    covered: float
    bounded: float


def outcome(found: Sequence[NoiseFigure], truth: float) -> Outcome:
    """Against the truth; `covered` of those that were told, `bounded` of those that were not."""
    told = [one for one in found if one.value is not None]
    untold = [one for one in found if one.value is None]
    errors = [abs(one.value / truth - 1.0) for one in told if one.value is not None and truth]
    return Outcome(
        len(told) / len(found),
        float(np.median(errors)) if errors else math.nan,
        float(np.mean([one.high is not None and one.low <= truth <= one.high for one in told])) if told else math.nan,
        float(np.mean([one.high is not None and truth <= one.high for one in untold])) if untold else math.nan,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=150)
    parser.add_argument("--flights", type=int, default=5)
    asked = parser.parse_args()
    print("| noise | figure | true | told | median error | interval holds | bound holds where not told |")
    print("|---|---|---|---|---|---|---|")
    for case in CASES:
        found = figures_of(case, range(asked.draws))
        for kind, sign in zip(KINDS, "NBK", strict=True):
            one = outcome(found[kind], case.truth[kind])
            shown = [f"{share:.0%}" if share == share else "–" for share in (one.told, one.median_error, one.covered)]
            bound = f"{one.bounded:.0%}" if one.bounded == one.bounded else "–"
            print(f"| {case.words} | {sign} | {case.truth[kind]:g} | {' | '.join(shown)} | {bound} |")
    print()
    flown_parameters(asked.flights)


def flown_parameters(flights: int) -> None:
    """Starting parameters of simulated flights: medians beside what the vehicle's file says of its noise."""
    mission = load_mission(ROOT / "config/missions/survey.yaml")
    print("| vehicle | parameter | at rest: true | measured | in flight: true | measured |")
    print("|---|---|---|---|---|---|")
    for name in ("quadrotor", "mistuned_quadrotor"):
        vehicle = load_vehicle(ROOT / "config/vehicles" / f"{name}.yaml")
        found: dict[str, list[tuple[float, float]]] = {}
        for seed in range(flights):
            flight = canonical(fly(mission, vehicle, {}, seed=seed))
            for one in sensor_noise(flight, airborne_intervals(flight, {})).starting:
                pair = (one.at_rest or math.nan, one.in_flight or math.nan)
                found.setdefault(one.parameter, []).append(pair)
        imu = vehicle.imu
        for parameter, sensor, density in (
            ("EKF2_GYR_NOISE", imu.gyro, imu.vibration.gyro_density),
            ("EKF2_ACC_NOISE", imu.accelerometer, imu.vibration.accelerometer_density),
        ):
            rest, flight_value = np.median(np.array(found[parameter]), axis=0)
            truth = sensor.noise_density / math.sqrt(0.01)
            in_flight = math.hypot(sensor.noise_density, density) / math.sqrt(0.01)
            print(f"| {name} | {parameter} | {truth:.3g} | {rest:.3g} | {in_flight:.3g} | {flight_value:.3g} |")


if __name__ == "__main__":
    main()
