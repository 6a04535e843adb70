"""The comparison with PX4 that anybody can run: with no arguments on the golden flights, with two on any others."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from benchmarks.fidelity_table import main
from benchmarks.reference_flights import GOLDEN_LOGS


def rows(text: str) -> dict[str, list[str]]:
    """Cells of each line below the header, by their first."""
    lines = [[cell.strip() for cell in line.strip("|\n").split("|")] for line in text.splitlines()]
    return {cells[0]: cells for cells in lines[2:]}


def test_golden_flights_are_compared_without_arguments(
    golden_reference: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([]) == 0
    table = rows(capsys.readouterr().out)
    assert table.keys() == {folder.name for folder in golden_reference.iterdir()} | {"**all**"}
    everything = table["**all**"]
    assert everything[1] == "5"
    assert float(everything[2].rstrip("%")) < 0.005
    assert everything[6:9] == ["100.000%", "100.000%", "equal"]
    assert {len(cells) for cells in table.values()} == {14}


def test_flight_that_cannot_be_compared_says_why_and_stops_no_other(
    golden_reference: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs, reference = tmp_path / "logs", tmp_path / "reference"
    logs.mkdir()
    for flight in ("mc_drag", "mc_gnss_yaw", "fw_airspeed"):
        shutil.copytree(golden_reference / flight, reference / flight)
        packed = (GOLDEN_LOGS / f"{flight}.ulg.xz").read_bytes()
        (logs / f"{flight}.ulg.xz").write_bytes(packed[: len(packed) // 2] if flight == "mc_drag" else packed)
    (logs / "fw_airspeed.ulg.xz").unlink()
    assert main([str(logs), str(reference), "--by-set"]) == 1
    table = rows(capsys.readouterr().out)
    assert "mc_drag.ulg.xz: cannot be unpacked" in table["mc_drag"][2]
    assert "fw_airspeed.ulg" in table["fw_airspeed"][2]
    assert table["mc_gnss_yaw paper5"][6] == "100.000%"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["only_logs"], "name both folders"),
        (["logs", "absent"], "absent: does not exist. Name the folder that holds one folder per flight"),
    ],
)
def test_wrong_folders_are_a_clear_error(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert said in capsys.readouterr().err
