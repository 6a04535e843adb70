"""`decide`, `compare` and `report`: what they say of folders of results."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from fusetune.apply.compared_results import compare_results
from fusetune.apply.decide_anew import decide_anew, settings_then
from fusetune.apply.decision_summary import decision_summary
from fusetune.apply.results_folder import ResultsFolder, results_folder
from fusetune.apply.settings import DecisionSettings
from fusetune.cli import main
from fusetune.errors import UserError
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.parquet import read_table

Captured = pytest.CaptureFixture[str]


def printed_json(capsys: Captured, *arguments: str | Path, status: int = 0) -> dict:
    assert main([str(one) for one in arguments]) == status
    captured = capsys.readouterr()
    assert captured.err == ""
    return json.loads(captured.out)


def test_with_the_settings_of_the_run_the_decision_anew_is_that_of_the_run(
    made_results: ResultsFolder, tmp_path: Path
) -> None:
    anew = decide_anew(made_results, tmp_path, DecisionSettings(**settings_then(made_results)))
    assert anew == made_results.decision
    for name in ("ranking.parquet", "per_flight.parquet", "best_params.params", "candidates.yaml"):
        assert (tmp_path / name).read_bytes() == (made_results.path / "apply" / name).read_bytes()


def test_other_settings_decide_otherwise_and_the_results_stay(
    made_results: ResultsFolder, tmp_path: Path, capsys: Captured
) -> None:
    before = made_results.decision_file.read_bytes()
    assert made_results.decision["chosen"] == "better"
    gain = next(one for one in made_results.decision["ranking"] if one["name"] == "better")["improvement_percent"]
    config = ["smallest_gain_percent=50", "decision.sources.gnss_vel=2", "seed=4"]
    document = printed_json(
        capsys, "decide", made_results.path, "--config", *config, "--out", tmp_path / "other", "--json"
    )
    assert gain < 50.0
    assert (document["decision"], document["before"]["decision"]) == ("keep", "change")
    assert document["settings_changed"] == {
        "smallest_gain_percent": {"before": 1.0, "now": 50.0},
        "sources.gnss_vel": {"before": 1.0, "now": 2.0},
        "seed": {"before": 3, "now": 4},
    }
    assert read_document(tmp_path / "other" / "decision.json")["status"] == "keep"
    assert made_results.decision_file.read_bytes() == before


def test_decide_prints_the_sentence_the_parameters_and_the_ranking(
    made_results: ResultsFolder, capsys: Captured
) -> None:
    # the folder that holds results/ serves as well
    assert main(["decide", str(made_results.path.parent)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("Change 1 parameter (set “better”): prediction errors ")
    assert lines[1] == "  EKF2_ACC_NOISE  0.35 → 0.2"
    assert lines[2] == "Before: the same."
    assert [line.split()[0] for line in lines[3:]] == ["set", "better", "present", "worse"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--config", "smallest_gain=2"], "did you mean 'smallest_gain_percent'?"),
        (["--config", "confidence"], "'confidence' is not KEY=VALUE"),
        (["--out", "inside"], "lies in the results"),
    ],
)
def test_what_decide_cannot_use_is_told(
    arguments: list[str], said: str, made_results: ResultsFolder, capsys: Captured
) -> None:
    given = [str(made_results.path / one) if one == "inside" else one for one in arguments]
    assert main(["decide", str(made_results.path), *given]) == 2
    assert said in capsys.readouterr().err


def test_a_folder_without_a_decision_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"holds no apply/decision\.json"):
        results_folder(tmp_path)
    with pytest.raises(UserError, match="is no folder"):
        results_folder(tmp_path / "none")


def test_equal_results_are_equal(made_results: ResultsFolder, tmp_path: Path, capsys: Captured) -> None:
    shutil.copytree(made_results.path, tmp_path / "copy")
    document = printed_json(capsys, "compare", made_results.path, tmp_path / "copy", "--json")
    assert document["equal"] is document["same_decision"] is True
    assert document["largest_score_difference_percent"] == 0.0


def test_what_differs_is_told_with_its_size(made_results: ResultsFolder, tmp_path: Path, capsys: Captured) -> None:
    """Scores of another weight of the aims: the difference by hand from the two tables."""
    other = tmp_path / "other"
    shutil.copytree(made_results.path, other)
    settings = DecisionSettings(**settings_then(made_results) | {"unaided_weight": 0.0, "smallest_gain_percent": 50.0})
    decide_anew(made_results, other / "apply", settings)
    found = compare_results(made_results, ResultsFolder(other))
    scores = [
        {(row["flight"], row["set"]): row["score"] for row in read_table(one / "apply/per_flight.parquet").to_pylist()}
        for one in (made_results.path, other)
    ]
    apart = {key: scores[1][key] / 1.0 - scores[0][key] for key in scores[0]}
    by_hand = max(abs(100.0 * (2.718281828459045**one - 1.0)) for one in apart.values())
    assert found.largest_percent == pytest.approx(by_hand, rel=1e-9)
    assert by_hand > 1.0
    assert not found.same_decision
    assert found.parameters == {"EKF2_ACC_NOISE": (pytest.approx(0.2), None)}
    assert found.settings == {"unaided_weight": (1.0, 0.0), "smallest_gain_percent": (1.0, 50.0)}
    assert main(["compare", str(made_results.path), str(other)]) == 1
    printed = capsys.readouterr().out
    assert printed.startswith("The decision is another.\n")
    assert "Setting unaided_weight: 1.0 → 0.0" in printed
    assert " EKF2_ACC_NOISE  0.2  –" in printed


def test_results_of_a_release_that_is_not_understood_are_told(
    made_results: ResultsFolder, tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "apply").mkdir()
    write_document(tmp_path / "apply" / "decision.json", {"status": "keep", "chosen": "present"})
    assert main(["compare", str(made_results.path), str(tmp_path)]) == 2
    assert "it lacks ranking, changes" in capsys.readouterr().err


def test_what_the_vehicle_cannot_be_given_is_said_with_the_decision(made_results: ResultsFolder) -> None:
    refused = {"name": "EKF2_DELAY_MAX", "reason": "v1.12 has no such parameter", "remedy": "Leave it out"}
    summary = decision_summary(made_results.decision | {"on_vehicle": {"parameters": [], "refused": [refused]}})
    assert "But nothing of it can be loaded: EKF2_DELAY_MAX: v1.12 has no such parameter." in summary.sentence
    assert not summary.can_be_loaded


def test_without_a_browser_report_says_what_to_install(
    made_results: ResultsFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    from fusetune.report import printed_page

    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(printed_page, "APPLICATIONS", ())
    with pytest.raises(UserError, match=r"no Chromium, Chrome or Edge on PATH.*print it from its menu"):
        printed_page.print_page(tmp_path / "page.html", tmp_path / "page.pdf")


def test_a_page_is_printed_by_the_browser_on_the_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in that writes what it is asked for where it is asked to; one that writes nothing is told of."""
    from fusetune.report.printed_page import print_page

    browser = tmp_path / "chromium"
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    for writes, ends in (('printf \'%%PDF-1.4 %s\' "$7" > "$out"', "printed"), ("echo no display >&2; exit 3", "told")):
        browser.write_text(
            f"#!/bin/sh\nfor one; do case $one in --print-to-pdf=*) out=${{one#*=}};; esac; done\n{writes}\n",
            encoding="utf-8",
        )
        browser.chmod(0o755)
        page, pdf = tmp_path / "page.html", tmp_path / f"{ends}.pdf"
        page.write_text("<p>", encoding="utf-8")
        if ends == "printed":
            print_page(page, pdf)
            assert pdf.read_bytes().startswith(b"%PDF")
        else:
            with pytest.raises(UserError, match="no display"):
                print_page(page, pdf)
            assert not pdf.exists()
