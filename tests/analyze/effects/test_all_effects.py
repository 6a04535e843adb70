"""All tuners on a simulated flight, from the log to the values: what was simulated lies in the intervals."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import date
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fusetune.analyze.effects.all_effects import all_effects
from fusetune.analyze.effects.drag import DragFit, air_density, estimate_drag, fit_drag
from fusetune.analyze.effects.gyro_attitude import gyro_attitude
from fusetune.analyze.effects.magnetic import estimate_magnetic
from fusetune.analyze.effects.motor_power import motor_power
from fusetune.analyze.effects.static_pressure import estimate_static_pressure, pressure_heights
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.numerics.constants import AIR_DENSITY_SEA_LEVEL
from fusetune.execute.world.earth import magnetic_field_ned
from fusetune.px4.flight import stacked
from fusetune.quaternions import rotation_matrix

if TYPE_CHECKING:
    from fusetune.analyze.effects.estimate import Effect, Estimate
    from fusetune.px4.flight import Flight

LINEAR_DRAG_1_S, CURRENT_GAUSS, GROUND_EFFECT_M, HOVER_THROTTLE = 0.25, 0.004, 0.8, 0.42
"""Of config/vehicles/quadrotor.yaml."""
ABSENT = ("range_lever_arm", "range_noise", "optical_flow", "vision_lever_arm", "airspeed_scale")


@pytest.fixture(scope="module")
def observed(survey_flight: Flight) -> ObservedFlight:
    return ObservedFlight(survey_flight)


@pytest.fixture(scope="module")
def effects(observed: ObservedFlight) -> dict[str, Effect]:
    return {one.id: one for one in all_effects(observed)}


def estimate(effects: dict[str, Effect], effect: str, name: str) -> Estimate:
    return next(one for one in effects[effect].estimates if one.name == name)


def test_momentum_drag(effects: dict[str, Effect], observed: ObservedFlight) -> None:
    found = estimate(effects, "drag", "EKF2_MCOEF")
    truth = LINEAR_DRAG_1_S / math.sqrt(air_density(observed) / AIR_DENSITY_SEA_LEVEL)
    assert found.lower < truth < found.upper
    assert found.told == pytest.approx(0.15)
    assert found.is_apart_from_told


def test_ground_effect_with_the_tenth_of_the_guide(effects: dict[str, Effect]) -> None:
    found = estimate(effects, "ground_effect", "EKF2_GND_EFF_DZ")
    assert found.lower < 1.1 * GROUND_EFFECT_M < found.upper < 4.0


def test_the_field_of_the_motors_has_its_strength(effects: dict[str, Effect]) -> None:
    """Over throttle, which the log tells, and 0.42 of which hovers; its direction is of chance."""
    found = effects["motor_magnetic_field"]
    strength = np.linalg.norm([one.value for one in found.estimates])
    error = max(one.upper - one.value for one in found.estimates)
    assert strength == pytest.approx(CURRENT_GAUSS / HOVER_THROTTLE, abs=error)
    assert error < 0.003 / HOVER_THROTTLE
    assert found.figures["CAL_MAG_COMP_TYP"] == 1.0


def test_declination_by_gnss(effects: dict[str, Effect]) -> None:
    field = magnetic_field_ned(47.397742, 8.545594, 535.0, date(2025, 6, 15))
    found = estimate(effects, "declination", "EKF2_MAG_DECL")
    assert found.lower < math.degrees(math.atan2(field[1], field[0])) < found.upper


def test_no_static_pressure_error_is_found_where_there_is_none(effects: dict[str, Effect]) -> None:
    for one in effects["static_pressure"].estimates:
        assert one.lower < 0.0 < one.upper


@pytest.mark.parametrize("effect", ABSENT)
def test_sensors_that_are_not_there_are_refused_in_words(effects: dict[str, Effect], effect: str) -> None:
    assert not effects[effect].estimates
    assert "the log has no" in effects[effect].refusal


def test_an_effect_is_told_or_refused(effects: dict[str, Effect]) -> None:
    for one in effects.values():
        assert one.estimates or one.refusal
        assert all(value.lower <= value.value <= value.upper for value in one.estimates)


def test_the_motion_is_the_true_one(observed: ObservedFlight, survey_flight: Flight) -> None:
    """Velocity within the receiver's 0.1 m/s, height within what walks away in a flight."""
    motion, truth = observed.motion, survey_flight.topics["vehicle_local_position_groundtruth", 0]
    assert motion is not None
    assert motion.by_gnss
    used = motion.within(observed.clear_of_ground)
    time = motion.time[used]
    for axis, name in enumerate(("vx", "vy", "vz")):
        true = np.interp(time, truth["timestamp"], truth[name])
        assert np.sqrt(np.mean((motion.velocity[used, axis] - true) ** 2)) < 0.12
    rise = motion.height[used] + np.interp(time, truth["timestamp"], truth["z"])
    assert np.std(rise) < 0.5


def test_the_gyros_attitude_drifts_evenly_and_keeps_the_true_tilt(
    observed: ObservedFlight, survey_flight: Flight
) -> None:
    """From the ground on, where the replay's own tilt is off by the bias of the accelerometer."""
    steps_of = observed.replayed.steps
    assert steps_of is not None
    attitude = gyro_attitude(steps_of(), observed.airborne)
    table = survey_flight.topics["vehicle_attitude_groundtruth", 0]
    time = table["timestamp"].astype(np.int64)
    inside = (time > attitude.time[500]) & (time < attitude.time[-1])
    down = rotation_matrix(stacked(table, "q")[inside])[:, 2]
    tilt = np.degrees(np.arccos(np.clip(np.sum(down * attitude.rotation_at(time[inside])[:, 2], axis=1), -1.0, 1.0)))
    assert np.max(tilt) < 0.7


def changed(observed: ObservedFlight, topic: str, columns: dict[str, np.ndarray]) -> ObservedFlight:
    """The same flight, with the same replay, of which a sensor read something else."""
    other = ObservedFlight(observed.logged)
    flight = observed.flight
    tables = dict(flight.topics) | {(topic, 0): flight.topics[topic, 0] | columns}
    vars(other).update(vars(observed) | {"flight": flight.with_topics(tables)})
    return other


def test_gravity_that_leaks_into_the_accelerometer_does_not_end_in_the_drag(observed: ObservedFlight) -> None:
    """0.2 m/s² along x is what a tilt of 1.2° leaves; the coefficients stay as they were."""
    motion = observed.motion
    assert motion is not None
    leaning = ObservedFlight(observed.logged)
    vars(leaning).update(vars(observed))
    vars(leaning)["motion"] = replace(motion, specific_force=motion.specific_force + [0.2, -0.1, 0.0])
    straight, slanting = estimate_drag(observed), estimate_drag(leaning)
    assert slanting.figures["offset_x_m_s2"] - straight.figures["offset_x_m_s2"] == pytest.approx(0.2, abs=0.03)
    one, other = ({one.name: one for one in effect.estimates}["EKF2_MCOEF"] for effect in (straight, slanting))
    assert abs(one.value - other.value) < 0.5 * (one.upper - one.value)


def test_a_static_pressure_error_is_found_where_there_is_one(observed: ObservedFlight) -> None:
    """0.25 of the dynamic pressure from ahead, on top of what the flight has; with it the wind counts more."""
    table, motion, drag = observed.flight.topics["vehicle_air_data", 0], observed.motion, fit_drag(observed)
    assert motion is not None
    assert isinstance(drag, DragFit)
    time = table["timestamp_sample"].astype(np.int64)
    velocity = motion.at(time, motion.velocity)
    velocity[:, :2] -= drag.wind(time * 1e-6)
    air = np.einsum("nji,nj->ni", motion.at(time, motion.rotation), velocity)
    error = 0.25 * pressure_heights(air, 400.0)[:, 0]
    wrong = changed(observed, "vehicle_air_data", {"baro_alt_meter": table["baro_alt_meter"] + error})
    before, after = (estimate_static_pressure(one, drag).estimates for one in (observed, wrong))
    found = {one.name: one for one in after}["EKF2_PCOEF_XP"]
    was = {one.name: one for one in before}["EKF2_PCOEF_XP"]
    assert found.lower < was.value + 0.25 < found.upper
    assert found.value - was.value == pytest.approx(0.25, abs=0.08)
    assert found.standard_error > was.standard_error


def test_a_motor_field_is_found_where_there_is_one(observed: ObservedFlight, effects: dict[str, Effect]) -> None:
    """Up to 30 mG at hover, on top of what the flight has."""
    table, field = observed.flight.topics["vehicle_magnetometer", 0], np.array([0.03, -0.02, 0.01])
    power = np.nan_to_num(motor_power(observed, table["timestamp_sample"].astype(np.int64)).power)
    columns = {f"magnetometer_ga[{axis}]": table[f"magnetometer_ga[{axis}]"] + field[axis] * power for axis in range(3)}
    found = estimate_magnetic(changed(observed, "vehicle_magnetometer", columns))[0]
    added = np.array(list(found.values().values())) - list(effects["motor_magnetic_field"].values().values())
    np.testing.assert_allclose(added, field, atol=1e-3)


def test_parameters_of_px4_take_the_other_sign_and_what_they_have_already(
    observed: ObservedFlight, effects: dict[str, Effect]
) -> None:
    """data + power · COMP − OFF: with throttle at 0.42 of weight COMP is −c/0.42, and OFF what it was and h."""
    flight = observed.flight
    device = int(flight.topics["vehicle_magnetometer", 0]["device_id"][0])
    told = {"CAL_MAG0_ID": device, "CAL_MAG0_ROT": 0, "CAL_MAG0_XOFF": 0.05, "CAL_MAG0_YCOMP": 0.02}
    parameters = replace(observed.logged.parameters, initial=observed.logged.parameters.initial | told)
    time = flight.topics["vehicle_magnetometer", 0]["timestamp_sample"].astype(np.int64)
    power = motor_power(observed, time).power
    known = np.isfinite(power)
    throttle = {"timestamp": time[known], "xyz[2]": -0.42 * power[known]}
    other = ObservedFlight(replace(observed.logged, parameters=parameters))
    kept = {name: value for name, value in vars(observed).items() if name != "logged"}
    topics = flight.topics | {("vehicle_thrust_setpoint", 0): throttle}
    vars(other).update(kept | {"flight": flight.with_topics(topics)})
    motor, iron, *_ = estimate_magnetic(other)
    assert motor.figures["CAL_MAG_COMP_TYP"] == 1.0
    before = effects["motor_magnetic_field"].values()
    assert motor.values()["CAL_MAG0_XCOMP"] == pytest.approx(-before["motor_field_x"] / 0.42, abs=2e-3)
    assert motor.values()["CAL_MAG0_YCOMP"] == pytest.approx(0.02 - before["motor_field_y"] / 0.42, abs=2e-3)
    iron_before = effects["hard_iron"].values()["hard_iron_x"]
    assert iron.values()["CAL_MAG0_XOFF"] == pytest.approx(0.05 + iron_before, abs=2e-3)
