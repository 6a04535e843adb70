"""Whose estimator replays a flight."""

from __future__ import annotations

from pathlib import Path

from fusetune.ekf2.releases.behaviours import MODELLED, RELEASES
from fusetune.px4.flight import Flight
from fusetune.px4.releases import ESTIMATORS
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save import save_log
from fusetune.save.flight_folder import METADATA_FILE
from fusetune.save.flights_table import write_flights_table
from fusetune.save.replayed_release import ReplayedRelease, replayed_release
from fusetune.storage.documents import read_document

V1_8, V1_13, V1_15, V1_17 = 0x010800FF, 0x010D03FF, 0x010F04FF, 0x011100FF


def of(version: int, *modelled: str, asked: str = "auto") -> ReplayedRelease:
    return replayed_release(Flight("f", info={"ver_sw_release": version}), asked, modelled)


def test_names_that_can_be_asked_for_are_those_of_the_estimators() -> None:
    assert ESTIMATORS == RELEASES
    assert {*MODELLED} <= {*RELEASES}


def test_the_release_that_flew_is_replayed_where_it_is_modelled_else_the_nearest() -> None:
    assert (of(V1_17, "v1.16", "v1.17").name, of(V1_17, "v1.16", "v1.17").reason) == ("v1.17", "")
    near = of(V1_13, "v1.15", "v1.16")
    assert (near.name, near.flew, near.flown.name) == ("v1.15", False, "v1.13")
    assert "v1.13 is none of the releases whose estimator is modelled, and v1.15 is the nearest" in near.reason
    assert of(V1_15, "v1.14", "v1.16").name == "v1.16"
    assert of(0x020000FF, "v1.16", "v1.17").name == "v1.17"
    assert "older than all releases" in of(V1_8, "v1.13", "v1.16").reason


def test_what_is_asked_for_counts_and_an_unknown_release_is_the_plain_text() -> None:
    asked = of(V1_17, "v1.16", "v1.17", asked="v1.16")
    assert (asked.name, asked.reason) == ("v1.16", "v1.16 is asked for")
    assert of(V1_17, "v1.16", "v1.17", asked="v1.17").reason == ""
    assert "main is none" in of(V1_17, "v1.16", "v1.17", asked="main").reason
    unknown = of(0, "v1.16", "main")
    assert (unknown.name, unknown.flew) == ("v1.16", False)
    assert "does not say which release flew" in unknown.reason


def test_metadata_and_table_tell_both_releases(tmp_path: Path) -> None:
    from tests.save.made_flight import made_flight

    write_ulog(tmp_path / "log.ulg", made_flight())
    verdict = save_log(tmp_path / "log.ulg", tmp_path / "log", release="v1.17")
    told = read_document(tmp_path / "log" / METADATA_FILE)["release"]
    assert (told["flown"], told["replayed"], told["reason"]) == ("v1.16", "v1.17", "v1.17 is asked for")
    (warning,) = [one for one in verdict.findings if one.id == "firmware"]
    assert (warning.severity, "behaves like v1.17: v1.17 is asked for" in warning.found) == ("warning", True)
    rows = write_flights_table([tmp_path / "log"], tmp_path / "flights.parquet", tmp_path / "flights.csv")
    assert (rows[0]["firmware"], rows[0]["replayed_as"]) == ("v1.16.0", "v1.17")
