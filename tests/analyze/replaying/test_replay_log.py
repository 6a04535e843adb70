"""Replays of set files on a log, as far as they go without the estimator."""

import json

import numpy as np
import pytest

from fusetune.analyze.replaying.replay_log import replay_log
from fusetune.analyze.replaying.replay_summary import ReplayIdentity
from fusetune.analyze.replaying.store.writer import finish_replay
from fusetune.ekf2.replay.results import ReplaySummary
from fusetune.errors import UserError
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.writer import write_ulog


def write_log(path):
    time = 1_000_000 + 5_000 * np.arange(20, dtype=np.int64)
    imu = {
        f"{name}[{axis}]": np.zeros(20, np.float32) for name in ("gyro_rad", "accelerometer_m_s2") for axis in (0, 1, 2)
    }
    imu |= {name: np.full(20, 5_000, np.uint32) for name in ("gyro_integral_dt", "accelerometer_integral_dt")}
    write_ulog(
        path, Flight("still", {("sensor_combined", 0): {"timestamp": time, **imu}}, start_timestamp=int(time[0]))
    )


@pytest.mark.parametrize("value", ["6e26", "NaN", "-Infinity"])
def test_a_set_that_nobody_can_fly_is_refused_with_file_and_limits(tmp_path, value):
    write_log(tmp_path / "log.ulg")
    (tmp_path / "sets").mkdir()
    (tmp_path / "sets" / "odd.json").write_text(f'{{"params": {{"EKF2_EV_DELAY": {value}}}, "overrides": {{}}}}')
    with pytest.raises(UserError, match="EKF2_EV_DELAY") as refused:
        replay_log(tmp_path / "log.ulg", tmp_path / "sets", tmp_path / "out")
    # a delay may lie outside of PX4's 0 to 300 ms by the width of that range
    assert "from -300 to 600" in str(refused.value) or value != "6e26"
    assert "odd.json" in str(refused.value)


@pytest.mark.parametrize(("levelled", "said"), [(False, "still enough"), (True, "samples end before")])
def test_a_replay_that_never_began_says_why(tmp_path, levelled, said):
    summary = ReplaySummary(
        mode="approx",
        imu_samples=5,
        updates=0,
        update_interval_us=0.0,
        origin=None,
        resets={},
        filter_fault_flags_max=0,
        diverged=False,
        levelled=levelled,
    )
    finish_replay(tmp_path, ReplayIdentity("base", {}, {}, "v1.16"), summary)
    written = json.loads((tmp_path / "base.json").read_text())
    assert written["status"] == "not_started"
    assert said in written["reason"]
