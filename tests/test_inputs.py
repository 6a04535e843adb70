"""What the configuration names is read before anything runs; as a user sees it: tests/workflow/test_messages.py."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fusetune.configuration import Configuration
from fusetune.errors import UserError
from fusetune.inputs import check_demonstration, read_inputs

PAPER_SETS = [f"paper{number}" for number in range(1, 7)]


@pytest.fixture
def settings(project_root: Path, tmp_path: Path) -> Configuration:
    default = Configuration()
    return replace(
        default,
        study=str(project_root / default.study),
        mission=str(project_root / default.mission),
        flights_dir=str(tmp_path),
        demonstration=replace(
            default.demonstration,
            study=str(project_root / default.demonstration.study),
            vehicle=str(project_root / default.demonstration.vehicle),
        ),
    )


def test_the_demonstration_flies_every_set_in_turn(settings: Configuration) -> None:
    once = read_inputs(settings, "config.yaml")
    assert once.is_demonstration
    assert once.flights == [f"flight_{number}_{name}" for number, name in enumerate(PAPER_SETS, 1)]
    twice = read_inputs(
        replace(settings, demonstration=replace(settings.demonstration, flights_per_set=2)), "config.yaml"
    )
    assert [twice.simulated[flight] for flight in twice.flights] == PAPER_SETS * 2
    assert twice.flights[0] == "flight_01_paper1"
    assert twice.flights == sorted(twice.flights)


def test_logs_are_the_flights_and_what_cannot_be_flown_is_no_empty_folder(
    settings: Configuration, tmp_path: Path
) -> None:
    (tmp_path / "a.ulg.gz").touch()
    refused = read_inputs(settings, "config.yaml")
    assert not refused.is_demonstration
    assert refused.flights == []
    (tmp_path / "a.ulg").touch()
    assert read_inputs(replace(settings, present_flight="a"), "config.yaml").flights == ["a"]
    with pytest.raises(UserError, match=r"config\.yaml: present_flight is 'b', which is no flight in"):
        read_inputs(replace(settings, present_flight="b"), "config.yaml")


def test_faults_of_the_demonstration_are_checked(settings: Configuration) -> None:
    def with_fault(flight: str, **fault: object) -> Configuration:
        return replace(settings, demonstration=replace(settings.demonstration, faults={flight: (fault,)}))

    good = with_fault("flight_1_paper1", kind="gnss_outage", start_s=3, duration_s=4)
    read_inputs(good, "config.yaml")
    check_demonstration(good, "config.yaml")
    with pytest.raises(UserError, match="names the flight 'flight_9'; expected one of flight_1_paper1, "):
        read_inputs(with_fault("flight_9"), "config.yaml")
    bad = with_fault("flight_1_paper1", kind="gnss_outage", start_s=3, duration_s=0)
    with pytest.raises(
        UserError, match=r"demonstration\.faults\.flight_1_paper1: faults\[0\]\.duration_s is 0; expected"
    ):
        check_demonstration(bad, "config.yaml")


def test_without_logs_the_papers_sets_are_flown_and_compared_with_logs_what_is_around_the_present(
    settings: Configuration, tmp_path: Path
) -> None:
    demonstrated = read_inputs(settings, "config.yaml")
    assert [one.name for one in demonstrated.study.sets] == PAPER_SETS
    assert demonstrated.study_file == settings.demonstration.study
    (tmp_path / "a.ulg").write_bytes(b"")
    flown = read_inputs(settings, "config.yaml")
    assert (flown.study.name, flown.study_file, flown.study.sets) == ("around_present", settings.study, ())
    (tmp_path / "a.ulg").unlink()
    with pytest.raises(UserError, match=r"demonstration\.study.*sets follow from flights"):
        read_inputs(replace(settings, demonstration=replace(settings.demonstration, study=settings.study)), "c.yaml")


def test_a_search_waits_for_logs_too(settings: Configuration, project_root: Path, tmp_path: Path) -> None:
    searching = replace(settings, study=str(project_root / "config/studies/search.yaml"))
    assert [one.name for one in read_inputs(searching, "config.yaml").study.sets] == PAPER_SETS
    (tmp_path / "a.ulg").write_bytes(b"")
    assert read_inputs(searching, "config.yaml").study.search is not None


def test_flights_are_compared_with_the_mission_and_those_of_a_folder(
    settings: Configuration, project_root: Path, tmp_path: Path
) -> None:
    alone = read_inputs(settings, "config.yaml")
    assert alone.mission_files == (settings.mission,)
    folder = tmp_path / "missions"
    folder.mkdir()
    survey = (project_root / "config/missions/survey.yaml").read_text(encoding="utf-8")
    (folder / "survey.yaml").write_text(survey, encoding="utf-8")
    (folder / "notes.txt").write_text("no mission", encoding="utf-8")
    several = replace(settings, missions_dir=str(folder))
    assert read_inputs(several, "config.yaml").mission_files == (settings.mission, str(folder / "survey.yaml"))
    (folder / "twin.yaml").write_text(survey, encoding="utf-8")
    with pytest.raises(UserError, match=r"twin\.yaml: has the name 'survey', as .*survey\.yaml has"):
        read_inputs(several, "config.yaml")
    (folder / "twin.yaml").write_text("name: twin\n", encoding="utf-8")
    with pytest.raises(UserError, match=r"twin\.yaml"):
        read_inputs(several, "config.yaml")
    with pytest.raises(UserError, match=r"config\.yaml: missions_dir is '.*nowhere', which is no folder"):
        read_inputs(replace(settings, missions_dir=str(tmp_path / "nowhere")), "config.yaml")


def test_a_search_compares_whole_flights(settings: Configuration, tmp_path: Path) -> None:
    (tmp_path / "a.ulg").touch()
    study = tmp_path / "search.yaml"
    study.write_text("name: found\nkind: search\n", encoding="utf-8")
    searching = replace(settings, study=str(study))
    read_inputs(searching, "config.yaml")
    hovering = replace(searching, decision=replace(settings.decision, only_classes=("hover",)))
    with pytest.raises(UserError, match=r"decision\.only_classes is set, and .*search\.yaml' is a search"):
        read_inputs(hovering, "config.yaml")
