"""The few names for scripts: what they give is what the rooms give."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import fusetune as ft


@pytest.fixture(scope="module")
def log_file(golden_logs: Path) -> Path:
    return sorted(golden_logs.glob("*.ulg"))[0]


@pytest.fixture(scope="module")
def log(log_file: Path) -> ft.Log:
    return ft.read(str(log_file))


def test_names_are_those_that_are_promised_and_typed():
    stub = ast.parse(Path(ft.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    typed = {name.asname for node in stub.body if isinstance(node, ast.ImportFrom) for name in node.names}
    assert typed == {*ft.__all__} <= {*dir(ft)}
    assert all(getattr(ft, name).__doc__ for name in ft.__all__)
    with pytest.raises(AttributeError, match="no attribute 'raed'"):
        _ = ft.raed


def test_the_package_itself_imports_nothing_heavy():
    heavy = "any(name in sys.modules for name in ('numpy', 'pandas', 'numba'))"
    code = f"import sys, fusetune; fusetune.__version__; sys.exit({heavy})"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_log_tells_what_it_holds(log: ft.Log, log_file: Path):
    assert log.name == log_file.stem
    assert "sensor_combined" in log.topics
    imu = log.topic("sensor_combined")
    assert imu["time_s"].is_monotonic_increasing
    assert imu["time_s"].iloc[-1] <= log.duration_s
    assert log.verdict.status == "replayable"
    assert "replayable" in repr(log)
    with pytest.raises(KeyError):
        log.topic("no_such_topic")


def test_a_replay_is_that_of_the_analyze_room(log: ft.Log, log_file: Path):
    """Row for row, in the order of the estimator; `axis` in letters, none where a source has one."""
    from fusetune.analyze.replaying.prepared_flight import prepare_flight
    from fusetune.px4.ulog.reader import read_ulog

    values = {"EKF2_GPS_V_NOISE": 0.6}
    prepared = prepare_flight(read_ulog(log_file))
    result, _ = prepared.replay(prepared.parameters(values), frozenset(values))
    replay = log.replay(values)
    table = replay.innovations
    np.testing.assert_array_equal(table["innovation"], result.innovations["innovation"])
    np.testing.assert_array_equal(table["source"].astype(str), result.source_names())
    assert set(table["axis"][table["source"] == "gnss_vel"]) == {"x", "y", "z"}
    assert set(table["axis"][table["source"] == "baro_hgt"]) == {""}
    assert replay.parameters["EKF2_GPS_V_NOISE"] == np.float32(0.6)
    states = replay.states
    np.testing.assert_allclose(np.linalg.norm(states.filter(like="quaternion").to_numpy(), axis=1), 1.0, rtol=1e-6)
    np.testing.assert_array_equal(states["sigma_velocity_d"], np.sqrt(result.states["covariances"][:, 5]))


def test_the_summary_is_what_its_formulas_say(log: ft.Log):
    replay = log.replay()
    one = replay.summary.set_index(["source", "axis"]).loc[("gnss_vel", "z")]
    rows = replay.innovations.query("source == 'gnss_vel' and axis == 'z'").astype({"innovation": float})
    rows = rows[rows["measured"]] if "measured" in rows else rows
    assert one["n"] == len(rows)
    assert one["rms"] == pytest.approx(np.sqrt(np.mean(rows["innovation"] ** 2)))
    assert one["mean_nis"] == pytest.approx(
        np.mean(rows["innovation"] ** 2 / rows["innovation_variance"].astype(float))
    )


def test_a_wrong_parameter_is_told_with_the_remedy(log: ft.Log):
    with pytest.raises(ft.UserError, match=r"EKF2_GPS_DELAYY: unknown EKF2 parameter. Use EKF2_GPS_DELAY"):
        log.replay({"EKF2_GPS_DELAYY": 100})
    with pytest.raises(ft.UserError, match=r"cannot be opened|does not exist|No such file"):
        ft.read("nowhere.ulg")


def test_sets_are_compared_with_the_present_one(log: ft.Log):
    """A set with the values that fly is neither better nor worse; the percent is that of the difference of scores."""
    own = log.replay().parameters["EKF2_GPS_V_NOISE"]
    compared = ft.compare([log], {"same": {"EKF2_GPS_V_NOISE": own}, "wide": {"EKF2_GPS_V_NOISE": 3.0}})
    assert compared.changes.loc[log.name, "same"] == 0.0
    wide = compared.ranking.set_index("set").loc["wide"]
    assert compared.changes.loc[log.name, "wide"] == pytest.approx(wide["change_percent"])
    assert wide["change_percent"] != 0.0
    nll = compared.metric("nll", "gnss_vel")
    assert nll.loc[log.name, "same"] == nll.loc[log.name, "present"]
    assert isinstance(compared.flights, pd.DataFrame)
    with pytest.raises(ft.UserError, match="present: has a name that means something already"):
        ft.compare([log], {"present": {}})


def test_a_folder_without_a_decision_is_named(tmp_path: Path):
    with pytest.raises(ft.UserError, match=r"holds no apply/decision.json"):
        ft.decide(tmp_path)


def test_processes_do_not_run_the_script_again(tmp_path: Path):
    """A script without `if __name__ == "__main__"` would start processes without end."""
    script = tmp_path / "script.py"
    script.write_text(
        "from fusetune.running.worker_processes import worker_processes\n"
        "print('once')\n"
        "with worker_processes(2) as pool:\n    print(sum(pool.map(abs, [-1, 2])))\n",
        encoding="utf-8",
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["once", "3"]


def test_the_sets_of_a_decision_are_a_study_that_the_pipeline_takes(
    log_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    from fusetune.design.study import load_study

    studies = []

    def run(command: list[str], **given: object) -> subprocess.CompletedProcess[str]:
        studies.append(load_study(Path(str(given["cwd"]), command[command.index("--study") + 1])))
        return subprocess.CompletedProcess(command, 2, "", "fusetune: it ends here.\n")

    monkeypatch.setattr(subprocess, "run", run)
    with pytest.raises(ft.UserError, match="the pipeline failed: it ends here"):
        ft.decide([log_file], {"late": {"EKF2_GPS_DELAY": 160}}, folder=tmp_path)
    assert [(one.name, dict(one.overrides)) for one in studies[0].sets] == [("late", {"EKF2_GPS_DELAY": 160.0})]


def test_a_replay_is_that_of_the_release_that_is_asked_for(log: ft.Log):
    assert log.replay().release == log.replay(release="v1.16").release == "v1.16"
    with pytest.raises(ft.UserError, match=r"v1\.9: is no release of PX4 whose estimator can be replayed"):
        log.replay(release="v1.9")
    with pytest.raises(ft.UserError, match=r"EKF2_GPS_MODE: v1\.16 has no such parameter"):
        log.replay({"EKF2_GPS_MODE": 1}, release="v1.16")
    assert log.replay({"SENS_GPS0_DELAY": 90}).parameters["EKF2_GPS_DELAY"] == 90.0
