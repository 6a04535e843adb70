"""States of a replay are read from their file, however that is cut into row groups."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from tests.analyze.made_flight import MadeSet, make_flight

from fusetune.analyze.replaying.replayed_set import STEP_BLOCKS, joined_steps
from fusetune.analyze.replaying.store.columns import state_table
from fusetune.analyze.replaying.store.reader import read_set, read_states, read_steps
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.replay.recording import STATE_ROW


def test_states_of_several_row_groups(tmp_path: Path) -> None:
    generator = np.random.default_rng(1)
    rows = np.zeros(50, STATE_ROW)
    rows["timestamp_sample"] = 10_000 * np.arange(50)
    rows["states"] = generator.normal(size=rows["states"].shape)
    rows["covariances"] = generator.random(size=rows["covariances"].shape)
    pq.write_table(state_table(rows), tmp_path / "a.states.parquet", row_group_size=7)
    found = read_states(tmp_path, "a")
    q, velocity = state.PUBLISHED_QUATERNION, state.PUBLISHED_VELOCITY
    np.testing.assert_array_equal(found.time, rows["timestamp_sample"])
    np.testing.assert_array_equal(found.quaternion, rows["states"][:, q : q + 4])
    np.testing.assert_array_equal(found.velocity, rows["states"][:, velocity : velocity + 3])
    for name, first in (("attitude", state.ATTITUDE), ("velocity", state.VELOCITY), ("position", state.POSITION)):
        np.testing.assert_array_equal(getattr(found, f"{name}_variance"), rows["covariances"][:, first : first + 3])


def test_steps_are_the_states_with_the_imu_that_they_were_predicted_with(tmp_path: Path) -> None:
    generator = np.random.default_rng(2)
    rows = np.zeros(30, STATE_ROW)
    rows["timestamp_sample"] = 10_000 * np.arange(30)
    for name in ("states", "delta_angle", "delta_angle_dt", "delta_velocity", "delta_velocity_dt"):
        rows[name] = generator.normal(size=rows[name].shape)
    pq.write_table(state_table(rows), tmp_path / "a.states.parquet", row_group_size=7)
    read, kept = read_steps(tmp_path, "a"), joined_steps([_piece(rows[:11]), _piece(rows[11:])])
    gyro, accel = state.PUBLISHED_GYRO_BIAS, state.PUBLISHED_ACCEL_BIAS
    for found in (read, kept):
        np.testing.assert_array_equal(found.time, rows["timestamp_sample"])
        np.testing.assert_array_equal(found.gyro_bias, rows["states"][:, gyro : gyro + 3])
        np.testing.assert_array_equal(found.accel_bias, rows["states"][:, accel : accel + 3])
        for name in ("delta_angle", "delta_angle_dt", "delta_velocity", "delta_velocity_dt"):
            np.testing.assert_array_equal(getattr(found, name), rows[name])
    part = read.rows(slice(3, 9))
    np.testing.assert_array_equal(part.delta_velocity_dt, rows["delta_velocity_dt"][3:9])


def _piece(rows: np.ndarray) -> dict[str, np.ndarray]:
    return {"time": rows["timestamp_sample"], **{name: one.of_rows(rows) for name, one in STEP_BLOCKS.items()}}


def test_replays_from_elsewhere_have_no_steps(tmp_path: Path) -> None:
    folder, _ = make_flight(tmp_path, "f", {"present": MadeSet()})[::-1]
    assert read_set(folder, "present").steps is None


def test_states_of_a_replay_that_never_started(tmp_path: Path) -> None:
    pq.write_table(state_table(np.zeros(0, STATE_ROW)), tmp_path / "a.states.parquet")
    found = read_states(tmp_path, "a")
    assert found.time.shape == (0,)
    assert found.quaternion.shape == (0, 4)
