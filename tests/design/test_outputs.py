"""Files that design writes, read back by other means."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq

from fusetune.design.outputs import write_design
from fusetune.design.study import load_study


def test_design_writes_plan_parameters_and_table(project_root: Path, tmp_path: Path) -> None:
    study_file = project_root / "config/studies/paper_table11.yaml"
    write_design(project_root / "config/missions/survey.yaml", study_file, tmp_path)
    study = load_study(study_file)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ["survey.plan", "sets.parquet", *(f"{one.name}.params" for one in study.sets)]
    )
    table = pq.read_table(tmp_path / "sets.parquet").to_pylist()
    assert len(table) == sum(len(one.overrides) for one in study.sets)
    for one in study.sets:
        rows = {row["parameter"]: row["value"] for row in table if row["set"] == one.name}
        assert rows == one.overrides


def test_parameter_file_has_lines_as_qgroundcontrol_reads_them(project_root: Path, tmp_path: Path) -> None:
    write_design(
        project_root / "config/missions/survey.yaml", project_root / "config/studies/paper_table11.yaml", tmp_path
    )
    lines = (tmp_path / "paper4.params").read_text().splitlines()
    values = {fields[2]: fields[3:] for line in lines if not line.startswith("#") for fields in [line.split("\t")]}
    # 0.7 as float32 with 18 decimals; type 9 is MAV_PARAM_TYPE_REAL32
    as_float32 = struct.unpack("<f", struct.pack("<f", 0.7))[0]
    assert values["EKF2_ACC_NOISE"] == [f"{as_float32:.18f}", "9"]


def test_reading_a_study_loads_no_numeric_library(project_root: Path) -> None:
    code = (
        "import sys; from fusetune.design.study import load_study; "
        "from fusetune.design.missions.mission import load_mission;"
        "print(sorted({'numpy', 'pandas', 'pyarrow', 'scipy', 'numba', 'matplotlib'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
