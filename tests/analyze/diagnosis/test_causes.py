"""Each cause: silent on a sound flight, and named by its own signs, with the severity and the values that follow."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.analyze.diagnosis.made_signs import (
    AIR,
    AIRSPEED,
    BAROMETER,
    BIAS,
    ERRORS,
    FIT,
    FLOW,
    GNSS,
    GNSS_MOTION,
    IMU,
    MAGNETOMETER,
    RANGE,
    VISION,
    fits,
    signs,
    with_values,
)

from fusetune.analyze.delays.lag import Lag
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.analyze.diagnosis.causes import (
    baro_ground_effect,
    flow_delay,
    flow_rotation,
    flow_scale,
    gnss_delay,
    gnss_lever_arm,
    gnss_loss,
    magnetic_disturbance,
    magnetometer_scale,
    parameter_at_limit,
    static_pressure,
    vision_scale,
    vision_yaw,
)
from fusetune.analyze.diagnosis.causes.registry import CAUSES
from fusetune.analyze.diagnosis.claims import AtLimit, NoiseClaim
from fusetune.analyze.diagnosis.diagnosis import Diagnosis
from fusetune.analyze.diagnosis.gnss_signs import Jump
from fusetune.analyze.diagnosis.height_errors import AXES, Effect
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.effects.estimate import Estimate
from fusetune.save.checks.standstill import Standstill


def effect(value: float, error: float = 0.1) -> Effect:
    return Effect(value, error, abs(value))


def barometer(**errors: Any) -> dict[str, Any]:
    return {"barometer": replace(BAROMETER, errors=replace(ERRORS, **errors))}


def magnetometer(found: dict[str, Any], **others: Any) -> dict[str, Any]:
    return {"magnetometer": replace(MAGNETOMETER, fits=found, **others)}


BODY = with_values(fits(0.1, body_field=0.004, motor_field=0.004), "body_field", body_field_x=0.15, body_field_y=0.05)
UPRIGHT = with_values(fits(0.1, body_field=0.004, motor_field=0.004), "body_field", body_field_x=0.01, body_field_z=0.2)
SCALED = with_values(fits(0.1, scale=0.004, body_field=0.06), "scale", scale_x=1.3, scale_y=0.8)

WRONG: dict[str, dict[str, Any]] = {
    "vibration": {"imu": replace(IMU, shaking=14.0)},
    "accelerometer_clipping": {"imu": replace(IMU, clipped=200, clipped_share=0.014, clipping=AIR[0])},
    "gyro_bias": {"gyro_bias": replace(BIAS, change=np.radians([0.1, 4.0, 0.2]))},
    "imu_gaps": {"imu": replace(IMU, gaps=(AIR[0],), lost_s=0.9, lost_share=0.02)},
    "yaw_alignment": magnetometer(BODY, compass_off=np.radians(40.0)),
    "magnetic_disturbance": magnetometer(
        fits(0.09), disturbed=(20_000_000, 31_000_000), disturbance=0.2, undisturbed=0.004
    ),
    "motor_magnetic_field": magnetometer(BODY, motors_off=np.zeros(3), in_air=np.array([0.15, 0.05, 0.01])),
    "magnetometer_rotated": magnetometer(fits(0.2, mounting=0.005)),
    "magnetometer_scale": magnetometer(SCALED),
    "gnss_accuracy": {"gnss": replace(GNSS, worst={"eph": 6.0, "s_variance_m_s": 1.3}, poor=AIR[0])},
    "gnss_glitch": {"gnss": replace(GNSS, jumps=(Jump(30_000_000, 12.0, False), Jump(35_000_000, 12.1, False)))},
    "gnss_loss": {"gnss": replace(GNSS, lost=((30_000_000, 38_000_000),))},
    "gnss_interference": {"gnss": replace(GNSS, jamming=170.0, jammed=AIR[0], satellites=7.0)},
    "gnss_lever_arm": {"gnss_motion": replace(GNSS_MOTION, arm=np.array([0.3, 0.1, 0.0]))},
    "baro_ground_effect": barometer(ground=effect(-3.0)),
    "static_pressure": barometer(speed={"forward": effect(0.6), "backward": effect(0.1), "sideways": effect(0.3)})
    | {"told_by": lambda _: {"EKF2_PCOEF_XP": Estimate("EKF2_PCOEF_XP", "", 0.0, -0.5, -0.6, -0.4, 0.05, 300)}},
    "propeller_wash": barometer(thrust=effect(-4.0)),
    "baro_drift": {"barometer": replace(BAROMETER, drift=6.0, inertial_drift=5.5)},
    "range_obstruction": {"range": replace(RANGE, short_share=0.3, constant_share=1.0, short=AIR[0], short_m=0.4)},
    "range_step": {"range": replace(RANGE, steps=((20_000_000, -0.9), (23_000_000, 0.9)))},
    "flow_scale": {"flow": replace(FLOW, scale=0.7, rotation=np.array([0.3, 0.3]))},
    "flow_delay": {"flow": replace(FLOW, fit=replace(FIT, delay_s=0.1))},
    "flow_rotation": {"flow": replace(FLOW, turn=np.radians(90.0))},
    "vision_scale": {"vision": replace(VISION, scale=0.7)},
    "vision_delay": {"vision": replace(VISION, fit=replace(FIT, delay_s=0.12))},
    "vision_covariance": {"vision": replace(VISION, velocity_noise=0.5, position_noise=0.3)},
    "airspeed_scale": {"airspeed": replace(AIRSPEED, scale=0.7)},
    "noise_claim": {"claims": {"baro_hgt": NoiseClaim("EKF2_BARO_NOISE", 0.05, 3.5, 0.3, 0.05)}},
    "parameter_at_limit": {"at_limits": (AtLimit("EKF2_ACC_NOISE", 1.0, False, 0.35),)},
    "instance_whipsaw": {"switches": np.arange(20, 32, 2) * 1_000_000},
    "sensor_stuck": {"stuck": {"mag": Standstill(8.0, 0.1, 0.2, 20_000_000, 28_000_000)}},
}


@pytest.mark.parametrize("id", sorted(CAUSES))
def test_a_sound_flight_shows_no_cause(id: str) -> None:
    assert CAUSES[id](signs()) is None


@pytest.mark.parametrize("id", sorted(WRONG))
def test_its_signs_show_the_cause_with_evidence_and_remedy(id: str) -> None:
    found = CAUSES[id](signs(**WRONG[id]))
    assert isinstance(found, Diagnosis)
    assert found.id == id
    assert found.severity in ("warning", "fail")
    assert 0.5 <= found.confidence <= 0.97
    assert found.signs
    assert found.remedy
    assert found.source
    assert found.stop_us > found.start_us
    first = found.signs[0]
    assert first.figure > first.usual


def test_a_noise_that_a_comparison_chose_is_not_called_back_to_its_default() -> None:
    """What shakes as much as EKF2 can be told is mended at the frame; any other bound is left."""
    shaken, gate = AtLimit("EKF2_ACC_NOISE", 1.0, False, 0.35), AtLimit("EKF2_BARO_GATE", 1.0, True, 5.0)
    found = parameter_at_limit.diagnose(signs(at_limits=(shaken,)))
    assert found is not None
    assert found.values == {}
    assert "balance the propellers" in found.remedy
    found = parameter_at_limit.diagnose(signs(at_limits=(shaken, gate)))
    assert found is not None
    assert found.values == {"EKF2_BARO_GATE": 5.0}
    assert "EKF2_ACC_NOISE and EKF2_BARO_GATE stand at bounds" in found.cause
    assert "Start again from the default" in found.remedy


def test_every_cause_is_tried() -> None:
    # these two need a replay or a message of vision, and are tried below
    assert set(CAUSES) - set(WRONG) == {"gnss_delay", "vision_yaw"}


def place(delay_s: float = 0.112, error_s: float = 0.006, arm: tuple[float, ...] = (0.0, 0.0, 0.0)) -> VelocityPlace:
    return VelocityPlace(Lag(delay_s, error_s, 1000, 300), np.array(arm), np.diag([0.015**2] * 3))


def asked(found: VelocityPlace | None, **others: Any) -> Signs:
    """Signs of a flight whose smoothed velocity tells a place."""
    flight = signs(**others, is_replayed=True)
    flight.observed.__dict__["gnss_place"] = found
    return flight


def test_a_delay_is_claimed_only_where_the_smoothed_velocity_agrees_and_tells_its_value() -> None:
    off = replace(GNSS_MOTION, fit=replace(FIT, delay_s=0.2))
    found = gnss_delay.diagnose(asked(place(0.188), gnss_motion=off))
    assert found is not None
    assert found.values == {"EKF2_GPS_DELAY": 190.0}
    assert "188 ms" in found.cause
    assert gnss_delay.diagnose(asked(place(0.115), gnss_motion=off)) is None


def test_the_antenna_is_where_the_smoothed_velocity_says() -> None:
    off = replace(GNSS_MOTION, arm=np.array([0.3, 0.1, 0.0]))
    found = gnss_lever_arm.diagnose(asked(place(arm=(0.26, 0.0, 0.0)), gnss_motion=off))
    assert found is not None
    assert found.values == {"EKF2_GPS_POS_X": 0.26, "EKF2_GPS_POS_Y": 0.0, "EKF2_GPS_POS_Z": 0.0}
    # 0.22 m with an error of 0.015 m may be less than the 0.2 m that a warning is worth
    small = gnss_lever_arm.diagnose(asked(place(arm=(0.0, 0.0, -0.22)), gnss_motion=off))
    assert small is not None
    assert (small.severity, found.severity) == ("note", "warning")
    assert gnss_lever_arm.diagnose(asked(place(), gnss_motion=off)) is None


def test_places_are_those_of_the_parameters_whose_imu_has_a_place_of_its_own() -> None:
    off = replace(GNSS_MOTION, arm=np.array([0.3, 0.0, 0.0]))
    told = {"EKF2_IMU_POS_X": 0.1, "EKF2_GPS_POS_X": 0.1}
    found = gnss_lever_arm.diagnose(asked(place(arm=(0.4, 0.0, 0.0)), gnss_motion=off, told=told))
    assert found is not None
    assert found.values["EKF2_GPS_POS_X"] == 0.4
    assert found.signs[0].figure == pytest.approx(0.3)


class Tuned:
    """Tuners that tell some estimates: value, and the two sides of its interval."""

    def __init__(self, error: float = 0.01, **estimates: tuple[float, float, float]) -> None:
        self.told = {
            name: Estimate(name, "", 1.0 if name.endswith("SCALE") else None, value, low, high, error, 100)
            for name, (value, low, high) in estimates.items()
        }

    def __call__(self, _: str) -> dict[str, Estimate]:
        return self.told


PRESSED = barometer(speed={"forward": effect(0.4), "backward": effect(0.1), "sideways": effect(0.1)})


def test_static_pressure_warns_where_the_tuner_tells_it_and_with_its_values() -> None:
    found = static_pressure.diagnose(signs(**PRESSED, told_by=Tuned(EKF2_PCOEF_XP=(-0.24, -0.44, -0.04))))
    assert found is not None
    assert (found.severity, found.values) == ("warning", {"EKF2_PCOEF_XP": -0.24})
    alone = static_pressure.diagnose(signs(**PRESSED, told_by=Tuned()))
    assert alone is not None
    assert alone.severity == "note"
    assert alone.confidence <= static_pressure.UNCONFIRMED
    assert static_pressure.diagnose(signs(**PRESSED, told_by=Tuned(EKF2_PCOEF_XP=(-0.02, -0.1, 0.06)))) is None


def test_no_share_of_the_pressure_is_beyond_the_pressure() -> None:
    alone = {"told_by": Tuned()}
    assert static_pressure.diagnose(signs(**barometer(speed=dict.fromkeys(AXES, effect(1.4))), **alone)) is None
    assert static_pressure.diagnose(signs(**barometer(speed=dict.fromkeys(AXES, effect(0.3))), **alone)) is not None


def test_the_tuner_decides_on_a_dip_that_the_sign_is_unsure_of() -> None:
    def dip(sign: float, zone: float) -> Diagnosis | None:
        told = Tuned(EKF2_GND_EFF_DZ=(zone, zone - 0.3, zone + 0.3))
        return baro_ground_effect.diagnose(signs(**barometer(ground=effect(-sign, 0.17)), told_by=told))

    # the zone is the dip and a tenth
    found = dip(1.3, 1.65)
    assert found is not None
    assert found.values == {"EKF2_GND_EFF_DZ": 1.6}
    assert dip(1.7, 1.1) is None
    assert dip(0.6, 1.65) is None


def test_the_tuner_decides_on_the_scale_of_vision_where_both_say_the_same_side() -> None:
    def scale(sign: float, told: float) -> Diagnosis | None:
        one = {"vision": replace(VISION, scale=sign, scale_error=0.02)}
        return vision_scale.diagnose(signs(**one, told_by=Tuned(vision_scale=(told, told - 0.02, told + 0.02))))

    found = scale(0.93, 0.91)
    assert found is not None
    assert found.values == {"vision_scale": 0.91}
    assert scale(0.93, 0.99) is None
    # vision in a frame that is turned leads the filter, and the tuner's motion with it
    assert scale(1.0, 0.8) is None
    assert scale(1.05, 0.8) is None


def test_the_tuner_decides_on_the_scale_of_flow() -> None:
    one = {"flow": replace(FLOW, scale=0.97, scale_error=0.1, rotation=np.array([0.1, 0.1]))}
    found = flow_scale.diagnose(signs(**one, told_by=Tuned(SENS_FLOW_SCALE=(1.14, 1.13, 1.15))))
    assert found is not None
    assert found.values == {"SENS_FLOW_SCALE": 1.14}
    assert flow_scale.diagnose(signs(**one, told_by=Tuned(SENS_FLOW_SCALE=(1.03, 1.02, 1.04)))) is None


def test_the_lag_of_flow_is_that_of_whoever_tells_it_better() -> None:
    unsure = {"flow": replace(FLOW, fit=replace(FIT, delay_s=0.08, delay_error_s=0.03))}
    found = flow_delay.diagnose(signs(**unsure, told_by=Tuned(error=5.0, EKF2_OF_DELAY=(110.0, 100.0, 120.0))))
    assert found is not None
    assert found.values == {"EKF2_OF_DELAY": 110.0}
    assert flow_delay.diagnose(signs(**unsure, told_by=Tuned(error=50.0, EKF2_OF_DELAY=(110.0, 10.0, 210.0)))) is None


def test_turning_that_is_not_left_in_the_flow_is_no_turn_whatever_the_way_says() -> None:
    # the way of a vehicle that shakes tells no scale: 0.04, give or take a quarter
    shaken = replace(FLOW, scale=0.04, scale_error=0.25, rotation=np.full(2, 0.02), rotation_error=np.full(2, 0.01))
    assert flow_rotation.not_turned(shaken)
    # nor does it where the scale is off and not told
    assert flow_rotation.not_turned(replace(shaken, scale=0.16, scale_error=0.22, rotation=np.full(2, 0.44)))
    left = replace(FLOW, rotation=np.full(2, -1.0))
    assert not flow_rotation.not_turned(left)
    assert flow_rotation.diagnose(signs(flow=left)) is not None


def test_a_receiver_that_never_reports_is_worth_knowing_and_one_that_falls_silent_a_failure() -> None:
    silent = signs(gnss=None, is_replayed=True)
    found = gnss_loss.diagnose(silent)
    assert found is not None
    assert found.severity == "note"
    # records of a damaged log may be missing
    assert gnss_loss.diagnose(signs(gnss=None)) is None
    on_ground = {"timestamp": np.array([8_000_000]), "fix_type": np.array([3])}
    silent.observed.flight.topics["vehicle_gps_position", 0] = on_ground
    found = gnss_loss.diagnose(silent)
    assert found is not None
    assert found.severity == "fail"
    assert gnss_loss.diagnose(signs({"EKF2_GPS_CTRL": 0.0}, gnss=None)) is None


def test_the_tuner_tells_a_scale_of_the_down_axis_from_a_field_along_it() -> None:
    upright = magnetometer(
        with_values(UPRIGHT | {"scale": replace(UPRIGHT["scale"], left=0.005)}, "scale", scale_z=1.27)
    )
    scale, field = magnetometer_scale.diagnose, magnetic_disturbance.diagnose
    found = scale(signs(**upright, told_by=Tuned(CAL_MAG0_ZSCALE=(0.8, 0.78, 0.82))))
    assert found is not None
    assert found.values["mag_scale_z"] == pytest.approx(1.25)
    assert found.confidence > 0.5
    assert field(signs(**upright, told_by=Tuned(CAL_MAG0_ZSCALE=(0.8, 0.78, 0.82)))) is None
    assert scale(signs(**upright, told_by=Tuned(CAL_MAG0_ZSCALE=(1.0, 0.97, 1.03)))) is None
    assert field(signs(**upright, told_by=Tuned(CAL_MAG0_ZSCALE=(1.0, 0.97, 1.03)))) is not None
    # at its best estimate no axis is off
    assert scale(signs(**magnetometer(SCALED), told_by=Tuned(CAL_MAG0_XSCALE=(1.01, 0.98, 1.04),
        CAL_MAG0_YSCALE=(0.99, 0.96, 1.02)))) is None  # fmt: skip
    # without it both are told
    assert scale(signs(**upright, told_by=Tuned())) is not None
    assert field(signs(**upright, told_by=Tuned())) is not None


def test_a_field_of_the_body_comes_before_a_scale_that_leaves_more() -> None:
    # log 10 of a sound quadrotor: both below the noise of its thinned readings, 0.0045 G
    found = with_values(fits(0.0154, scale=0.0043, body_field=0.0041), "scale", scale_y=1.1, scale_z=0.86)
    assert magnetometer_scale.diagnose(signs(**magnetometer(found, noise=0.0045))) is None


@pytest.mark.parametrize(
    ("id", "name", "value"),
    [
        ("baro_ground_effect", "EKF2_GND_EFF_DZ", 3.6),
        ("airspeed_scale", "ASPD_SCALE_1", 1.38),
        ("flow_scale", "SENS_FLOW_SCALE", 1.41),
        ("vision_scale", "vision_scale", 0.69),
        ("motor_magnetic_field", "motor_field_x", 4.2),
    ],
)
def test_a_cause_that_is_an_effect_tells_the_value_of_its_tuner(id: str, name: str, value: float) -> None:
    tuned = Tuned(**{name: (value, 0.9 * value, 1.1 * value)})
    found = CAUSES[id](signs(**WRONG[id], told_by=tuned))
    assert found is not None
    assert found.values == {name: value}


def test_a_turned_frame_of_vision_matters_where_vision_says_that_it_knows_north() -> None:
    turned = replace(VISION, turn=np.radians(30.0))
    frame = {"timestamp": np.arange(3), "pose_frame": np.array([1, 1, 1])}
    flight = signs(vision=turned)
    assert vision_yaw.diagnose(flight) is None
    flight.observed.flight.topics["vehicle_visual_odometry", 0] = frame
    found = vision_yaw.diagnose(flight)
    assert found is not None
    assert found.values["vision_turn_deg"] == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("id", "not_these", "changed"),
    [
        ("motor_magnetic_field", ("yaw_alignment",), WRONG["motor_magnetic_field"]),
        ("magnetometer_scale", ("motor_magnetic_field", "yaw_alignment"), WRONG["magnetometer_scale"]),
        ("magnetometer_rotated", ("magnetic_disturbance", "yaw_alignment"), WRONG["magnetometer_rotated"]),
        ("magnetic_disturbance", ("yaw_alignment", "motor_magnetic_field"), magnetometer(UPRIGHT, compass_off=0.02)),
        ("propeller_wash", ("baro_ground_effect",), barometer(thrust=effect(5.0), ground=effect(-2.5))),
        ("baro_ground_effect", ("propeller_wash",), barometer(thrust=effect(-2.0), ground=effect(-4.0))),
        ("flow_scale", ("flow_rotation",), WRONG["flow_scale"]),
        ("gnss_interference", ("gnss_glitch", "gnss_loss"), WRONG["gnss_interference"]),
    ],
)
def test_what_looks_alike_is_told_apart(id: str, not_these: tuple[str, ...], changed: dict[str, Any]) -> None:
    flight = signs(**changed)
    assert CAUSES[id](flight) is not None
    assert [other for other in not_these if CAUSES[other](flight) is not None] == []


def test_an_offset_that_is_there_at_rest_is_no_vibration() -> None:
    off = replace(GNSS_MOTION, bias_down=0.9)
    shaken = CAUSES["vibration"](signs(gnss_motion=off))
    assert shaken is not None
    assert shaken.signs[0].figure == pytest.approx(0.9, abs=0.01)
    # at rest the sensor's bias of 0.9 m/s² down takes as much from what it feels of gravity
    assert CAUSES["vibration"](signs(gnss_motion=off, imu=replace(IMU, resting_force=9.80665 - 0.9))) is None


@pytest.mark.parametrize("share", [0.0004, 0.0006])
def test_a_landing_that_clips_a_sample_is_no_clipping(share: float) -> None:
    imu = replace(IMU, clipped=6, clipped_share=share, clipping=AIR[0])
    assert (CAUSES["accelerometer_clipping"](signs(imu=imu)) is not None) == (share > 0.0005)


def test_a_position_without_a_fix_is_lost_and_not_stuck() -> None:
    lost = replace(GNSS, lost=((20_000_000, 28_000_000),))
    stuck = {"gnss": Standstill(8.0, 0.1, 47.0, 20_000_000, 28_000_000)}
    assert CAUSES["sensor_stuck"](signs(gnss=lost, stuck=stuck)) is None
    assert CAUSES["gnss_loss"](signs(gnss=lost, stuck=stuck)) is not None
