"""Sequences of external vision samples: start, frames, resets, loss of quality and of data."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import START_US, hovering, parameters, set_time

from fusetune.ekf2.feed.sensor_samples import EV_FRAME_BODY_FRD, EV_FRAME_FRD, EV_FRAME_NED
from fusetune.ekf2.filter.aid_sources.external_vision.ev_control import control_external_vision_fusion
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_BARO, HEIGHT_REF_EV

HPOS, VPOS, VEL, YAW = 1, 2, 4, 8
SAMPLE_INTERVAL_US = 40_000


class Vision:
    """Offers samples at regular intervals and runs the control function on them."""

    def __init__(self, params: np.ndarray, memory: np.ndarray, frame: int = EV_FRAME_NED) -> None:
        self.params, self.ekf, self.frame = params[0], memory[0], frame
        self.now = START_US

    def offer(
        self,
        position: tuple[float, float, float] = (1.0, 2.0, -10.0),
        velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        reset_counter: int = 0,
        quality: int = 100,
        velocity_frame: int | None = None,
    ) -> None:
        self.now += SAMPLE_INTERVAL_US
        ekf, sample = self.ekf, self.ekf["sensors"]["ev"]["sample"]
        set_time(ekf, self.now)
        ekf["time_last_hgt_fuse"] = max(ekf["time_last_hgt_fuse"], self.now - 1)
        sample["time_us"] = self.now
        sample["pos"], sample["vel"] = position, velocity
        sample["quat"] = [math.cos(yaw / 2.0), 0.0, 0.0, math.sin(yaw / 2.0)]
        sample["position_var"] = sample["velocity_var"] = sample["orientation_var"] = 0.01
        sample["pos_frame"] = self.frame
        sample["vel_frame"] = self.frame if velocity_frame is None else velocity_frame
        sample["reset_counter"], sample["quality"] = reset_counter, quality
        ekf["sensors"]["ev"]["data_ready"] = ekf["sensors"]["ev"]["exists"] = True
        ekf["sensors"]["ev"]["newest_time_us"] = self.now
        ekf["ev"]["newest_quality"] = quality
        self.run()

    def wait(self, seconds: float) -> None:
        self.now += round(seconds * 1e6)
        set_time(self.ekf, self.now)
        self.ekf["sensors"]["ev"]["data_ready"] = False
        self.run()

    def run(self) -> None:
        self.ekf["cs_prev"] = self.ekf["cs"]
        self.ekf["state_reset_prev"]["pos_ne_counter"] = self.ekf["state_reset"]["pos_ne_counter"]
        control_external_vision_fusion(self.ekf, self.params)

    def flags(self) -> dict[str, bool]:
        return {name: bool(self.ekf["cs"][f"ev_{name}"]) for name in ("pos", "hgt", "vel", "yaw")}


@pytest.fixture
def ned() -> Vision:
    params = parameters(EKF2_EV_CTRL=HPOS | VPOS | VEL, EKF2_HGT_REF=HEIGHT_REF_EV)
    memory = hovering(params)
    memory[0]["cs"]["yaw_align"] = True
    return Vision(params, memory)


def test_the_second_sample_starts_everything_asked_for(ned: Vision) -> None:
    ned.offer()
    assert not any(ned.flags().values()), "one sample shows no regular rate"
    ned.offer(position=(1.0, 2.0, -12.0), velocity=(0.5, 0.0, -0.1))
    assert ned.flags() == {"pos": True, "hgt": True, "vel": True, "yaw": False}
    ekf = ned.ekf
    np.testing.assert_allclose(ekf["vel"], [0.5, 0.0, -0.1])
    assert ekf["gpos_alt"] == 12.0
    assert ekf["height_sensor_ref"] == HEIGHT_REF_EV
    assert ekf["state_reset"]["pos_ne_counter"] >= 1
    assert ekf["state_reset"]["pos_d_counter"] == 1


def test_gaps_delay_the_start(ned: Vision) -> None:
    ned.offer()
    ned.wait(0.2)
    ned.offer()
    assert not any(ned.flags().values())


def test_velocity_in_a_local_frame_has_no_sample_time(ned: Vision) -> None:
    for _ in range(3):
        ned.offer()
    assert ned.ekf["aid"]["ev_vel"]["fused"]
    assert ned.ekf["aid"]["ev_vel"]["timestamp_sample"] == 0


def test_body_velocity_is_turned_into_ned() -> None:
    params = parameters(EKF2_EV_CTRL=VEL)
    memory = hovering(params)
    ekf = memory[0]
    ekf["cs"]["yaw_align"] = True
    ekf["q"] = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
    ekf["R_to_earth"] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    vision = Vision(params, memory)
    for _ in range(2):
        vision.offer(velocity=(3.0, 0.0, 0.0), velocity_frame=EV_FRAME_BODY_FRD)
    np.testing.assert_allclose(ekf["vel"], [0.0, 3.0, 0.0], atol=1e-12)
    # five times the measurement's variance, which EKF2_EVV_NOISE keeps from falling below 0.01
    assert ekf["P"][3, 3] == pytest.approx(0.05, rel=1e-6)
    vision.offer(velocity=(3.1, 0.0, 0.0), velocity_frame=EV_FRAME_BODY_FRD)
    assert ekf["aid"]["ev_vel"]["timestamp_sample"] == vision.now
    assert ekf["aid"]["ev_vel"]["fused"]
    assert 3.0 < ekf["vel"][1] < 3.1


def test_vision_yaw_in_its_own_frame_gives_up_true_north() -> None:
    params = parameters(EKF2_EV_CTRL=HPOS | YAW)
    memory = hovering(params)
    memory[0]["cs"]["yaw_align"] = True
    vision = Vision(params, memory, EV_FRAME_FRD)
    for _ in range(2):
        vision.offer(yaw=0.4)
    assert vision.flags()["yaw"]
    assert not memory[0]["cs"]["yaw_align"]
    assert 2.0 * math.asin(memory[0]["q"][3]) == pytest.approx(0.4, abs=1e-9)
    # the noise parameter stands for the variance as it is
    assert memory[0]["aid"]["ev_yaw"]["observation_variance"][0] == pytest.approx(0.1, rel=1e-6)


def test_gnss_forbids_vision_yaw_of_another_frame() -> None:
    params = parameters(EKF2_EV_CTRL=YAW)
    memory = hovering(params)
    memory[0]["cs"]["yaw_align"] = memory[0]["cs"]["gnss_pos"] = memory[0]["cs"]["gnss_vel"] = True
    vision = Vision(params, memory, EV_FRAME_FRD)
    for _ in range(3):
        vision.offer(yaw=0.4)
    assert not vision.flags()["yaw"]


def test_beside_gnss_only_the_bias_of_vision_jumps() -> None:
    params = parameters(EKF2_EV_CTRL=HPOS)
    memory = hovering(params)
    ekf = memory[0]
    ekf["cs"]["yaw_align"] = ekf["cs"]["gnss_pos"] = True
    vision = Vision(params, memory)
    for _ in range(2):
        vision.offer(position=(7.0, -3.0, -10.0))
    assert vision.flags()["pos"]
    assert ekf["state_reset"]["pos_ne_counter"] == 0
    assert ekf["ev_pos_b_est"]["north"]["bias"] == pytest.approx(7.0, abs=1e-6)
    assert ekf["ev_pos_b_est"]["east"]["bias"] == pytest.approx(-3.0, abs=1e-6)
    vision.offer(position=(27.0, -3.0, -10.0), reset_counter=1)
    assert ekf["ev_pos_b_est"]["north"]["bias"] == pytest.approx(27.0, abs=1e-6)
    assert ekf["state_reset"]["pos_ne_counter"] == 0


def test_a_reset_of_vision_resets_position_and_height(ned: Vision) -> None:
    for _ in range(3):
        ned.offer()
    position_resets = int(ned.ekf["state_reset"]["pos_ne_counter"])
    ned.offer(position=(50.0, 2.0, -30.0), reset_counter=1)
    assert ned.ekf["state_reset"]["pos_ne_counter"] == position_resets + 1
    assert ned.ekf["gpos_alt"] == 30.0
    assert ned.flags()["pos"]
    assert ned.flags()["hgt"]


def test_a_reset_of_poor_quality_stops_vision() -> None:
    params = parameters(EKF2_EV_CTRL=HPOS | VPOS, EKF2_HGT_REF=HEIGHT_REF_EV, EKF2_EV_QMIN=50)
    memory = hovering(params)
    memory[0]["cs"]["yaw_align"] = True
    vision = Vision(params, memory)
    for _ in range(3):
        vision.offer(quality=80)
    assert vision.flags()["pos"]
    vision.offer(quality=20)
    assert vision.flags()["pos"], "poor samples are only left out"
    assert vision.ekf["aid"]["ev_pos"]["innovation_rejected"]
    vision.offer(quality=20, reset_counter=1)
    assert not any(vision.flags().values())


def test_silence_for_two_intervals_stops_vision(ned: Vision) -> None:
    for _ in range(3):
        ned.offer()
    ned.wait(0.4)
    assert ned.flags()["pos"]
    ned.wait(0.01)
    assert not any(ned.flags().values())
    assert not ned.ekf["ev"]["q_error_initialized"]


def test_rejected_positions_are_followed_after_a_second(ned: Vision) -> None:
    for _ in range(3):
        ned.offer()
    resets = int(ned.ekf["state_reset"]["pos_ne_counter"])
    for _ in range(25):
        ned.offer(position=(100.0, 2.0, -10.0))
    assert ned.ekf["state_reset"]["pos_ne_counter"] == resets
    ned.offer(position=(100.0, 2.0, -10.0))
    assert ned.ekf["state_reset"]["pos_ne_counter"] == resets + 1
    assert ned.ekf["ev"]["nb_pos_reset_available"] == 4


@pytest.mark.parametrize(("reference", "height"), [(HEIGHT_REF_BARO, 10.0), (HEIGHT_REF_EV, 12.0)])
def test_where_all_heights_fail_vision_resets_as_the_reference_alone(reference: int, height: float) -> None:
    params = parameters(EKF2_EV_CTRL=VPOS, EKF2_HGT_REF=reference)
    memory = hovering(params)
    ekf = memory[0]
    ekf["cs"]["yaw_align"], ekf["gpos_alt"], ekf["height_sensor_ref"] = True, 10.0, reference
    vision = Vision(params, memory)
    vision.offer()
    vision.offer()
    assert ekf["cs"]["ev_hgt"]
    ekf["vel"][2] = 0.5
    # a bad vertical acceleration for 1 s of the 0.5 s that v1.16 allows; it leaves the vertical velocity
    ekf["time_good_vert_accel"] = vision.now - 1_000_000
    ekf["sensors"]["ev"]["sample"]["pos"] = 1.0, 2.0, -12.0
    vision.run()
    assert ekf["gpos_alt"] == pytest.approx(height, abs=0.2)
    assert ekf["vel"][2] == pytest.approx(0.5, abs=0.05)
