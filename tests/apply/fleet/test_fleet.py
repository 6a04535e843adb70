"""`fleet.json`, from the table of health and the diagnoses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.apply.fleet.made_fleet import VEHICLE, date, found, made_diagnosis, row, write_health_rows

from fusetune.apply.fleet.fleet import write_fleet
from fusetune.apply.fleet.flights import read_fleet_table
from fusetune.errors import UserError
from fusetune.storage.documents import read_document, write_document


def made_rows() -> list[dict]:
    """Three flights of two vehicles; the last one was refused, and has but one figure."""
    return [
        row("b", "gnss.eph", 1.0, date=date(3), threshold=3.0),
        row("b", "gnss.eph", 4.0, date=date(3), threshold=3.0, severity="fail", instance=1),
        row("b", "baro.rate_hz", 20.0, date=date(3), unit="Hz", group="sensor"),
        row("a", "gnss.eph", 2.0, date=date(1), threshold=3.0),
        row("a", "gnss.eph", 9.0, date=date(1), threshold=3.0, severity="fail", origin="replay"),
        row("a", "range.rate_hz", None, date=date(1), severity="does-not-apply", unit=""),
        row("a", "filter.faults", 1024.0, date=date(1), severity="fail", unit=""),
        row("refused", "baro.rate_hz", 10.0, date="", vehicle="another", unit="Hz", group="sensor"),
    ]


@pytest.fixture
def health(tmp_path: Path) -> Path:
    return write_health_rows(tmp_path / "analyze" / "health.parquet", made_rows())


def test_flights_stand_by_date_and_a_figure_is_the_vehicles_own_worst(health: Path) -> None:
    table = read_fleet_table(health)
    assert [one.name for one in table.flights] == ["a", "b", "refused"]
    assert [one.id for one in table.figures] == ["gnss.eph", "baro.rate_hz", "filter.faults"]
    assert table.figures[0].limit == 3.0
    # of a the vehicle's, though the replay's is worse; of b the instance that fails
    np.testing.assert_array_equal(table.values[:, 0], [2.0, 4.0, np.nan])
    np.testing.assert_array_equal(table.values[:, 1], [np.nan, 20.0, 10.0])


def test_flags_are_judged_and_no_quantity(health: Path) -> None:
    table = read_fleet_table(health)
    assert np.isnan(table.values[:, 2]).all()
    assert table.severities[0, 2] == 4


def test_the_document_tells_flights_causes_and_figures(health: Path, tmp_path: Path) -> None:
    for flight, diagnoses in {
        "a": [found("vibration", "warning"), found("gnss_delay", "note")],
        "b": [found("vibration", "fail")],
    }.items():
        write_document(tmp_path / f"{flight}.json", made_diagnosis(flight, diagnoses))
    output = tmp_path / "fleet.json"
    write_fleet(health, [tmp_path / "a.json", tmp_path / "b.json"], output)
    document = read_document(output)
    assert [one["name"] for one in document["flights"]] == ["a", "b", "refused"]
    assert [one["is_diagnosed"] for one in document["flights"]] == [True, True, False]
    assert document["flights"][1]["counts"] == {"pass": 1, "note": 0, "warning": 0, "fail": 1}
    first, second = document["causes"]
    assert (first["id"], first["severity"], first["flights"]) == ("vibration", "fail", ["a", "b"])
    # without b it would be a warning
    assert first["hangs_on"] == "b"
    assert first["vehicles"] == [VEHICLE]
    assert (second["id"], second["hangs_on"]) == ("gnss_delay", "a")
    rate = next(one for one in document["figures"] if one["id"] == "baro.rate_hz")
    assert rate["distribution"]["median"] == 15.0
    assert rate["by"]["vehicle"]["another"]["mean"] == 10.0
    assert rate["by"]["month"]["2026-01"]["n"] == 1
    assert rate["by"]["firmware"] == {}


def test_the_same_flights_make_the_same_bytes(health: Path, tmp_path: Path) -> None:
    for name in ("one.json", "two.json"):
        write_fleet(health, [], tmp_path / name)
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()


def test_no_flights_are_a_fleet(tmp_path: Path) -> None:
    write_fleet(write_health_rows(tmp_path / "health.parquet", []), [], tmp_path / "fleet.json")
    assert read_document(tmp_path / "fleet.json")["flights"] == []


def test_the_table_is_one_line_for_pandas(health: Path) -> None:
    worst = pd.read_parquet(health).query("severity == 'fail' and origin == 'vehicle'").groupby("id").flight.nunique()
    assert worst.to_dict() == {"filter.faults": 1, "gnss.eph": 1}


def test_files_that_cannot_be_used_are_named(health: Path, tmp_path: Path) -> None:
    write_document(tmp_path / "other.json", {"flights": []})
    with pytest.raises(UserError, match=r"other\.json.*what is wrong with a flight"):
        write_fleet(health, [tmp_path / "other.json"], tmp_path / "fleet.json")
    with pytest.raises(UserError, match=r"lost\.parquet"):
        write_fleet(tmp_path / "lost.parquet", [], tmp_path / "fleet.json")
    assert not (tmp_path / "fleet.json").exists()
