"""The health table in files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from fusetune.analyze.health.health_files import SCHEMA, write_health, write_health_table
from fusetune.analyze.health.health_table import health_rows
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.errors import UserError
from fusetune.px4.flight import Flight
from fusetune.save.flight_folder import write_flight


@pytest.fixture(scope="module")
def files(survey_flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Health of two flights: one of a mission, and one that lacks GNSS."""
    folder = tmp_path_factory.mktemp("health")
    blind = {key: table for key, table in survey_flight.topics.items() if "gps" not in key[0] and "gnss" not in key[0]}
    found = []
    for flight, mission in (
        (replace(survey_flight, name="first"), "survey"),
        (replace(survey_flight, name="second", topics=blind), ""),
    ):
        (folder / flight.name).mkdir()
        write_flight(folder / flight.name, flight)
        write_health(folder / flight.name, folder / f"{flight.name}.json", mission=mission)
        found.append(folder / f"{flight.name}.json")
    return found


def test_the_document_holds_the_rows_of_the_flight(files: list[Path], survey_flight: Flight) -> None:
    document = json.loads(files[0].read_text())
    expected = [row.document() for row in health_rows(ObservedFlight(survey_flight))]
    assert document["rows"] == json.loads(json.dumps(expected))
    assert (document["flight"], document["mission"]) == ("first", "survey")
    assert document["firmware"] == survey_flight.release_name


def test_one_line_of_pandas_reads_the_health_of_all_flights(files: list[Path], tmp_path: Path) -> None:
    write_health_table(files, tmp_path / "health.parquet")
    table = pd.read_parquet(tmp_path / "health.parquet")
    assert list(table.columns) == SCHEMA.names
    assert list(table["flight"].unique()) == ["first", "second"]
    fixes = table[table["id"] == "gnss.eph"]
    assert list(fixes["flight"]) == ["first"]
    (whole,) = table[(table["id"] == "flight.airborne_s") & (table["flight"] == "first")].to_dict("records")
    assert whole["stop_s"] - whole["start_s"] == pytest.approx(whole["figure"])
    assert whole["origin"] == "vehicle"
    assert pd.isna(whole["instance"])
    assert table.groupby("flight").size().min() > 50


def test_of_no_flights_there_is_a_table_without_lines(tmp_path: Path) -> None:
    write_health_table([], tmp_path / "health.parquet")
    assert list(pd.read_parquet(tmp_path / "health.parquet").columns) == SCHEMA.names


def test_a_file_of_something_else_is_named(files: list[Path], tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.json"
    damaged.write_bytes(files[0].read_bytes().replace(b"gnss", b"gnsz", 1))
    with pytest.raises(UserError, match="damaged"):
        write_health_table([damaged], tmp_path / "health.parquet")
    with pytest.raises(UserError, match=r"missing\.json"):
        write_health_table([tmp_path / "missing.json"], tmp_path / "health.parquet")
    assert not (tmp_path / "health.parquet").exists()
