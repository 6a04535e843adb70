"""States of a replay are read from their file, however that is cut into row groups."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from fusetune.analyze.replaying.store.columns import state_table
from fusetune.analyze.replaying.store.reader import read_states
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


def test_states_of_a_replay_that_never_started(tmp_path: Path) -> None:
    pq.write_table(state_table(np.zeros(0, STATE_ROW)), tmp_path / "a.states.parquet")
    found = read_states(tmp_path, "a")
    assert found.time.shape == (0,)
    assert found.quaternion.shape == (0, 4)
