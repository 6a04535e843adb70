"""The decision on made studies of which the right answer is known."""

import json
import re
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pytest
from tests.analyze.made_flight import MadeSet
from tests.apply.study import make_study

from fusetune.apply.decide import decide
from fusetune.apply.parameter_files.names import PARAMETER_FILES
from fusetune.apply.recommended import Recommended
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.upload.judged import read_judged
from fusetune.apply.upload.values import Value
from fusetune.design.study import load_study
from fusetune.errors import UserError
from fusetune.px4.parameters.params_file import read_params
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.parquet import write_table

OUTPUTS = (
    "ranking.parquet",
    "ranking.csv",
    "per_flight.parquet",
    "decision.json",
    *PARAMETER_FILES,
    "candidates.yaml",
    "sensitivity.json",
)
QUIET = {"EKF2_ACC_NOISE": 0.2, "EKF2_GYR_NOISE": 0.015}
PRESENT = {"EKF2_ACC_NOISE": 0.35, "EKF2_GYR_NOISE": 0.015}


def run(root: Path, sets: dict[str, MadeSet], flights: int = 6, **options: Any) -> dict[str, Any]:
    folders, table = make_study(
        root, sets, flights, **{k: options.pop(k) for k in ("refused", "landing_s") if k in options}
    )
    decide(folders, table, root / "apply", sets=list(sets), **options)
    return json.loads((root / "apply" / "decision.json").read_text())


def ranked(decision: dict[str, Any], name: str) -> dict[str, Any]:
    return next(one for one in decision["ranking"] if one["name"] == name)


def test_a_clearly_better_set_is_chosen_and_written(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13, overrides=PRESENT), "better": MadeSet(error=0.1, overrides=QUIET)}
    decision = run(tmp_path, sets)
    assert (decision["status"], decision["chosen"], decision["exploratory"]) == ("change", "better", False)
    assert ranked(decision, "better")["improvement_percent"] == pytest.approx(100 * (1 - 0.1 / 0.13), abs=3.0)
    # Only what changes, with the value before; the gyroscope noise is the same in both sets.
    (entry,) = read_params(tmp_path / "apply" / "best_params.params")
    assert (entry.name, entry.type) == ("EKF2_ACC_NOISE", "FLOAT")
    assert entry.value == pytest.approx(0.2, abs=1e-7)
    assert "previous value 0.35 m/s^2, new value 0.2 m/s^2" in entry.comments[0]
    assert "better on 6 of 6 flights" in entry.comments[1]
    assert re.search(r"smaller \(95% interval \+\d", entry.comments[1])
    assert [one["kind"] for one in decision["next_steps"]] == ["load", "confirm", "load"]
    assert decision["paragraphs"][-1].startswith("Next: (1) Load best_params.params")
    (back,) = read_params(tmp_path / "apply" / "rollback.params")
    assert (back.name, back.value) == ("EKF2_ACC_NOISE", pytest.approx(0.35, abs=1e-7))
    # what an upload asks of it
    judged = read_judged(tmp_path / "apply" / "best_params.params")
    old, new, same = (Value.of("FLOAT", number) for number in (0.35, 0.2, 0.015))
    assert dict(judged.wanted) == {"EKF2_ACC_NOISE": new}
    assert {"EKF2_ACC_NOISE": old, "EKF2_GYR_NOISE": same}.items() <= judged.present.items()
    assert (judged.uuid, judged.release) == ("", "v1.16.0")
    undone = read_judged(tmp_path / "apply" / "rollback.params")
    assert (undone.wanted["EKF2_ACC_NOISE"], undone.present["EKF2_ACC_NOISE"]) == (old, new)


def test_identical_sets_keep_the_present_one(tmp_path: Path) -> None:
    same = {name: MadeSet(own=0.0, overrides=PRESENT) for name in ("present", "twin", "triplet")}
    decision = run(tmp_path, same)
    assert (decision["status"], decision["chosen"]) == ("keep", "present")
    assert ranked(decision, "twin")["equal_to_present"]
    assert ranked(decision, "twin")["p_best"] == pytest.approx(1 / 3)
    assert read_params(tmp_path / "apply" / "best_params.params") == []
    assert "nothing to load" in (tmp_path / "apply" / "best_params.params").read_text()


def test_a_difference_of_chance_keeps_the_present_set(tmp_path: Path) -> None:
    sets = {name: MadeSet(own=1.0) for name in ("present", "a", "b", "c")}
    decision = run(tmp_path, sets)
    assert decision["status"] == "keep"
    assert "Keep the parameters that fly now." in decision["paragraph"]
    # how the flights moved is told by the analysis: they stand still
    assert next(one["kind"] for one in decision["missing_motion"]) == "delays"
    assert decision["power"]["flights"] == 6
    assert {one["gain_percent"] for one in decision["power"]["curves"]} == {5.0, 10.0, 20.0}


def test_inflated_noise_is_not_chosen_though_its_mean_nis_is_least(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.1, claimed=0.1), "inflated": MadeSet(error=0.105, claimed=1.0)}
    decision = run(tmp_path, sets)
    assert decision["chosen"] == "present"
    ranking = pd.read_parquet(tmp_path / "apply" / "ranking.parquet").set_index("name")
    assert ranking.loc["inflated", "mean_nis_gnss_vel"] < 0.1 * ranking.loc["present", "mean_nis_gnss_vel"]


def test_fewer_than_five_flights_are_exploratory(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.15), "better": MadeSet(error=0.1, overrides=QUIET)}
    decision = run(tmp_path, sets, flights=4)
    assert decision["exploratory"]
    assert "exploratory" in decision["paragraph"]
    assert "exploratory" in (tmp_path / "apply" / "best_params.params").read_text()


def test_a_single_flight_is_decided_by_its_blocks_only_and_called_exploratory(tmp_path: Path) -> None:
    decision = run(tmp_path, {"present": MadeSet(), "b": MadeSet(own=1.0)}, flights=1)
    assert decision["exploratory"]
    assert decision["flights_scored"] == 1


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        (
            MadeSet(error=0.05, resets_s=(40.0,)),
            "6 resets that moved the state far (by up to 3 m), the present set has 0",
        ),
        (MadeSet(error=0.05, fault_flags=8), "filter fault fs_bad_hdg on flight_0"),
        (MadeSet(error=0.05, lost_gnss_s=40.0), "6 lost aid sources, the present set has 0"),
        (MadeSet(error=0.05, status="diverged"), "flight_0: diverged: the covariance is not finite"),
        (MadeSet(error=0.05, overrides={"EKF2_ACC_NOISE": 9.0}), "EKF2_ACC_NOISE"),
        (MadeSet(error=0.05, claimed=0.01), "beyond the gate, the present set has 0.0 %"),
    ],
)
def test_vetoes(tmp_path: Path, made: MadeSet, reason: str) -> None:
    decision = run(tmp_path, {"present": MadeSet(error=0.1), "tempting": made})
    assert decision["chosen"] == "present"
    assert any(reason in one for one in ranked(decision, "tempting")["reasons"])
    assert "tempting" in decision["paragraph"]
    assert ranked(decision, "tempting")["status"] == ("not scored" if made.status == "diverged" else "not eligible")


def test_resets_that_hardly_move_the_state_rule_nothing_out(tmp_path: Path) -> None:
    made = MadeSet(error=0.05, resets_s=(40.0,), jump_m=0.3, overrides=QUIET)
    decision = run(tmp_path, {"present": MadeSet(error=0.1, overrides=PRESENT), "calm": made})
    assert (decision["status"], decision["chosen"]) == ("change", "calm")


def test_a_set_that_is_ruled_out_and_predicts_better_leads_to_candidates(tmp_path: Path) -> None:
    bold = MadeSet(error=0.05, resets_s=(40.0,), overrides={"EKF2_GPS_V_NOISE": 0.1, "EKF2_ACC_NOISE": 0.1})
    decision = run(tmp_path, {"present": MadeSet(error=0.1, overrides=PRESENT), "bold": bold})
    assert (decision["status"], ranked(decision, "bold")["status"]) == ("keep", "not eligible")
    proposed = {one["name"]: one["overrides"] for one in decision["candidates"]}
    # its innovations of 0.1 m/s beside a noise of 0.3 lead to another one
    measured = {name: proposed[name] for name in proposed if name.startswith("measured")}
    assert list(measured) == ["measured_gps_v_noise"]
    # The gate of 5 at a noise of 0.3 m/s reaches as far as one of 15 at 0.1; √(0.3 · 0.1) and √(0.35 · 0.1)
    assert proposed == measured | {
        "bold_wider_gates": {"EKF2_ACC_NOISE": 0.1, "EKF2_GPS_V_GATE": 15.0, "EKF2_GPS_V_NOISE": 0.1},
        "bold_halfway": {"EKF2_ACC_NOISE": 0.187, "EKF2_GPS_V_NOISE": 0.173},
    }
    assert (
        "Ruled out, though better than now beyond doubt by its predictions: “bold” (errors 4" in decision["paragraph"]
    )
    assert "bold_halfway (EKF2_ACC_NOISE 0.187, EKF2_GPS_V_NOISE 0.173)" in decision["paragraph"]
    # one matter each, as the page shows them
    assert " ".join(decision["paragraphs"]) == decision["paragraph"]
    assert any(one.startswith("Ruled out, though better") for one in decision["paragraphs"])
    study = load_study(tmp_path / "apply" / "candidates.yaml")
    assert {one.name: one.overrides for one in study.sets} == proposed


def test_a_set_that_resets_all_the_time_changes_nothing_for_the_others(tmp_path: Path) -> None:
    """A set better by a quarter is found beside one whose resets lie 3 s apart on every flight, as without it."""
    sets = {"present": MadeSet(error=0.13, overrides=PRESENT), "better": MadeSet(error=0.1, overrides=QUIET)}
    restless = {"restless": MadeSet(error=0.02, resets_s=tuple(float(second) for second in range(11, 69, 3)))}
    alone, beside = (run(tmp_path / name, made) for name, made in (("alone", sets), ("beside", sets | restless)))
    assert (alone["chosen"], beside["chosen"]) == ("better", "better")
    figures = ("score", "difference", "flights", "aims")
    for name in sets:
        one, other = ranked(alone, name), ranked(beside, name)
        assert {figure: one[figure] for figure in figures[:3]} == {figure: other[figure] for figure in figures[:3]}
    assert ranked(beside, "restless")["status"] == "not eligible"
    assert ranked(beside, "restless")["score"] > ranked(beside, "present")["score"] - 0.05


def test_a_set_that_fails_on_one_flight_is_not_eligible_but_shown(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.1), "tempting": MadeSet(error=0.05)}
    folders, table = make_study(tmp_path, sets)
    summary = read_document(folders[2] / "scoring.json")
    summary["sets"]["tempting"] |= {"status": "excluded", "reason": "starts aiding 28.0 s later than the present set"}
    write_document(folders[2] / "scoring.json", summary)
    for name in ("scores.parquet", "withheld.parquet"):
        scores = pd.read_parquet(folders[2] / name)
        left = pa.Table.from_pandas(scores[scores["set"] != "tempting"], preserve_index=False)
        write_table(left, folders[2] / name)
    decide(folders, table, tmp_path / "apply", sets=list(sets))
    decision = json.loads((tmp_path / "apply" / "decision.json").read_text())
    one = ranked(decision, "tempting")
    assert (one["status"], one["flights"], decision["status"]) == ("not eligible", 5, "keep")
    assert "flight_2: starts aiding 28.0 s later" in one["reasons"][0]
    assert {aim["flights"] for aim in one["aims"].values()} == {5}


def test_no_flight_at_all_is_no_evidence_and_a_valid_file(tmp_path: Path) -> None:
    decision = run(tmp_path, {"present": MadeSet(), "b": MadeSet()}, flights=0, refused=("bad",))
    assert (decision["status"], decision["chosen"]) == ("no_evidence", "present")
    assert all((tmp_path / "apply" / name).exists() for name in OUTPUTS)
    assert read_params(tmp_path / "apply" / "best_params.params") == []


def test_flights_that_cannot_be_scored_are_no_evidence_with_the_reason(tmp_path: Path) -> None:
    decision = run(tmp_path, {"present": MadeSet(), "b": MadeSet()}, flights=2, landing_s=12.0)
    assert decision["status"] == "no_evidence"
    assert "s of flight remain" in decision["paragraph"]
    assert decision["flights"][0]["reason"].startswith("only 2.0 s")


def test_the_decision_is_the_same_bytes_twice_and_in_any_order_of_flights(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13, overrides=PRESENT), "b": MadeSet(overrides=QUIET), "c": MadeSet(error=0.2)}
    folders, table = make_study(tmp_path, sets)
    contents = []
    for attempt, order in enumerate((folders, folders[::-1])):
        output = tmp_path / f"apply_{attempt}"
        decide(order, table, output, sets=list(sets))
        contents.append({name: (output / name).read_bytes() for name in OUTPUTS})
    assert contents[0] == contents[1]


def test_provenance_names_every_log_and_configuration_file(tmp_path: Path) -> None:
    config = tmp_path / "config.yaml"
    config.write_text("seed: 1\n")
    decision = run(tmp_path, {"present": MadeSet()}, flights=2, refused=("bad",), configuration_files=[config])
    assert [(row["flight"], row["status"], row["scored"]) for row in decision["flights"]] == [
        ("bad", "refused", False),
        ("flight_0", "replayable", True),
        ("flight_1", "replayable", True),
    ]
    assert all(len(row["checksum"]) == 64 and row["firmware"] for row in decision["flights"])
    # SHA-256 of "seed: 1\n"
    import hashlib

    expected = hashlib.sha256(b"seed: 1\n").hexdigest()
    assert decision["provenance"]["configuration_files"] == {"config.yaml": expected}
    assert decision["provenance"]["product"].startswith("fusetune ")


def test_previous_values_are_those_of_the_newest_flight(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13), "better": MadeSet(error=0.1, overrides=QUIET)}
    folders, table = make_study(tmp_path, sets)
    summary = read_document(folders[1] / "scoring.json")
    summary["sets"]["present"]["parameters"]["EKF2_ACC_NOISE"] = 0.5
    write_document(folders[1] / "scoring.json", summary)
    decide(folders, table, tmp_path / "apply", sets=list(sets), newest_flight="flight_1")
    decision = json.loads((tmp_path / "apply" / "decision.json").read_text())
    assert decision["changes"][0]["previous"] == 0.5


def test_an_unknown_newest_flight_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="nowhere"):
        run(tmp_path, {"present": MadeSet()}, flights=1, newest_flight="nowhere")


@pytest.fixture(scope="module")
def many_candidates(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], Path, list[str]]:
    """Folders, table of flights and sets of a study in which one of eight candidates is a little better."""
    sets = {"present": MadeSet(error=0.1)} | {f"s{i}": MadeSet(error=0.1, own=0.6) for i in range(8)}
    sets["s3"] = MadeSet(error=0.096, own=0.6)
    return *make_study(tmp_path_factory.mktemp("many_candidates"), sets), list(sets)


@pytest.mark.parametrize("multiplicity", ["sign_flips", "holm", "none"])
def test_the_number_of_candidates_is_allowed_for(
    many_candidates: tuple[list[Path], Path, list[str]], tmp_path: Path, multiplicity: str
) -> None:
    folders, table, sets = many_candidates
    settings = DecisionSettings(multiplicity=multiplicity)
    decide(folders, table, tmp_path / "apply", sets=sets, settings=settings)
    decision = json.loads((tmp_path / "apply" / "decision.json").read_text())
    best = ranked(decision, decision["best_candidate"])
    assert best["p_holm"] > best["p_value"]
    p_value = {"sign_flips": best["p_family"], "holm": best["p_holm"], "none": 0.0}[multiplicity]
    assert (decision["status"] == "change") == (best["upper"] < 0.0 and p_value <= 0.05)


def test_a_flight_whose_replay_cannot_be_trusted_does_not_count(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13, overrides=PRESENT), "better": MadeSet(error=0.1, overrides=QUIET)}
    folders, table = make_study(tmp_path, sets)
    for folder, grade, compared in zip(folders, "ABCDDA", (True, True, True, True, False, True), strict=True):
        reason = "the replay resets its height 144 times" if grade == "D" else ""
        fidelity = {"grade": grade, "trust": {"is_compared": compared, "reason": reason}}
        write_document(folder / "fidelity.json", fidelity)
    decide(folders, table, tmp_path / "apply", sets=list(sets))
    decision = json.loads((tmp_path / "apply" / "decision.json").read_text())
    # The fourth has a D; the fifth, too, but only because its log holds nothing to compare with.
    assert [row["scored"] for row in decision["flights"]] == [True, True, True, False, True, True]
    assert decision["flights"][3]["reason"] == (
        "its replay has trust grade D (the replay resets its height 144 times), and the decision takes none below C"
    )
    assert "1 replayed flight does not count, as its replay has a trust grade below C." in decision["paragraph"]
    assert "could not be scored" not in decision["paragraph"]


def test_flights_that_have_no_say_are_told_by_what_keeps_them_out(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13, overrides=PRESENT), "better": MadeSet(error=0.1, overrides=QUIET)}
    folders, table = make_study(tmp_path / "long", sets, 5)
    short, _ = make_study(tmp_path / "short", sets, 2, landing_s=12.0)
    for number, folder in enumerate(short):
        summary = read_document(folder / "scoring.json")
        write_document(folder / "scoring.json", summary | {"flight": f"short_{number}"})
    for folder in folders[:2]:
        fidelity = {"grade": "D", "trust": {"is_compared": True}}
        write_document(folder / "fidelity.json", fidelity)
    decide([*folders, *short], table, tmp_path / "apply", sets=list(sets), newest_flight="flight_4")
    text = json.loads((tmp_path / "apply" / "decision.json").read_text())["paragraph"]
    assert "2 replayed flights could not be scored." in text
    assert "2 replayed flights do not count, as their replays have trust grades below C." in text
    for folder in folders:
        write_document(folder / "fidelity.json", fidelity)
    decide(folders, table, tmp_path / "apply", sets=list(sets))
    text = json.loads((tmp_path / "apply" / "decision.json").read_text())["paragraph"]
    assert "none of the 5 replayed flights has a say (flight_0: its replay has trust grade D, and" in text


def test_a_set_has_one_part_in_files_and_page(tmp_path: Path) -> None:
    sets = {
        "present": MadeSet(error=0.1),
        "same": MadeSet(error=0.1, own=0.0),
        "restless": MadeSet(error=0.05, resets_s=(40.0,)),
        "worse": MadeSet(error=0.2),
        "able": MadeSet(error=0.099, own=0.6),
    }
    decision = run(tmp_path, sets)
    expected = {"present": "flies now", "restless": "not eligible", "worse": "not eligible", "able": "eligible"}
    table = pd.read_csv(tmp_path / "apply" / "ranking.csv").set_index("set")
    for name, status in expected.items():
        assert ranked(decision, name)["status"] == table.loc[name, "status"] == status
    assert "so not eligible: worse." in decision["paragraph"]
    assert "Ruled out, and so not eligible: restless" in decision["paragraph"]


def test_leaving_out_flights_is_reported(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13, overrides=PRESENT), "better": MadeSet(error=0.1, overrides=QUIET)}
    validated = run(tmp_path, sets)["leave_one_out"]
    assert set(validated["chosen"].values()) == {"better"}
    assert (validated["stays"], len(validated["chosen"])) == (6, 6)
    assert validated["upper"] < 0.0


def test_a_source_is_trusted_as_far_as_its_error_is_white() -> None:
    settings = DecisionSettings(distrust_white_share=0.6, trust_white_share=0.9)
    assert [settings.trust(share) for share in (0.2, 0.6, 0.75, 0.9, 1.0)] == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])


def test_a_set_that_stands_for_what_a_search_found_is_written_as_found_on_all(tmp_path: Path) -> None:
    """On each flight it was replayed with other values; those that are written are given."""
    sets = {"present": MadeSet(error=0.13, overrides=PRESENT), "found": MadeSet(error=0.1, overrides=QUIET)}
    found = Recommended("found", {"EKF2_ACC_NOISE": 0.25}, {"EKF2_ACC_NOISE": "alone it brings 3 %"})
    decision = run(tmp_path, sets, recommended=found)
    assert (decision["status"], decision["chosen"]) == ("change", "found")
    (entry,) = read_params(tmp_path / "apply" / "best_params.params")
    assert entry.value == pytest.approx(0.25, abs=1e-7)
    assert entry.comments[1] == "alone it brings 3 %"


def test_what_speaks_against_the_very_values_rules_the_set_out(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13, overrides=PRESENT), "found": MadeSet(error=0.1, overrides=QUIET)}
    decision = run(tmp_path, sets, recommended=Recommended("found", QUIET, objections=("it resets all the time",)))
    assert decision["status"] == "keep"
    assert ranked(decision, "found")["reasons"] == ["it resets all the time"]
