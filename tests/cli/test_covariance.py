from __future__ import annotations

import csv
from pathlib import Path

import pytest

from fusetune.cli import main

DESIGN = """
kind: linear
name: landing
model: marker_landing
judged: [p_x, v_x]
variations: [{name: at 60 Hz, changes: {marker.rate_hz: 60}}]
sweeps: [{name: camera, label: for $x or $y, lines: [marker.sd], factors: [0.5, 1, 2], states: [p_x]}]
"""


def test_a_design_becomes_tables_and_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    design = tmp_path / "landing.yaml"
    design.write_text(DESIGN, encoding="utf-8")
    assert main(["covariance", str(design), "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "p_x: 0.03483 m just before a correction"
    assert printed[1].split() == ["-33.4", "%", "gyro:", "noise", "÷2"]
    with open(tmp_path / "covariance.csv", encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    keys = [(row["variation"], row["state"]) for row in rows]
    assert len(keys) == len(set(keys)) == 4 * len({name for name, _ in keys})
    base = next(row for row in rows if (row["variation"], row["state"]) == ("as designed", "p_x"))
    assert float(base["sd_before_correction"]) == pytest.approx(34.83e-3, rel=1e-3)
    assert (base["unit"], float(base["change_percent"])) == ("m", 0.0)
    drawn = {file.name for file in tmp_path.glob("*.svg")}
    assert drawn == {"tornado.svg", "sweep_camera.svg"}
    assert {"pays_most.csv", "sweeps.csv"} <= {file.name for file in tmp_path.iterdir()}


def test_a_broken_design_is_one_line_and_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    design = tmp_path / "design.yaml"
    design.write_text("kind: linear\nname: x\nmodel: marker_landing\nparameters: {height: 1}\n", encoding="utf-8")
    assert main(["covariance", str(design), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert "unknown key 'height'" in told
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()
