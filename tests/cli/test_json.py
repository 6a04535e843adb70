"""`--json`: one document, and every key of it is in the manual."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from fusetune.apply.results_folder import ResultsFolder
from fusetune.cli import main
from fusetune.cli.command_line import COMMANDS
from fusetune.cli.output.json_document import print_document
from fusetune.cli.output.run_outcome import run_outcome


def manual_of(command: str, root: Path) -> str:
    """Its row of the table of documents."""
    text = (root / "docs" / "command.md").read_text(encoding="utf-8").partition("## JSON")[2]
    row = next(line for line in text.splitlines() if line.startswith(f"| `{command}` |"))
    return row.replace("`decision` … `next_step`", manual_of("run", root)) if command == "decide" else row


def keys_of(document: Any) -> set[str]:
    first = document[0] if isinstance(document, list) else document
    keys = set(first)
    for value in first.values():
        if isinstance(value, list) and value and isinstance(value[0], dict) and "is_present" not in value[0]:
            keys |= set(value[0])
    return keys


@pytest.mark.parametrize("command", ["init", "save", "study", "mission", "decide", "compare"])
def test_a_command_prints_one_document_of_what_the_manual_says(
    command: str, made_results: ResultsFolder, project_root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.ulg").write_bytes(b"this is no ULog")
    config = project_root / "config"
    arguments: dict[str, list[Path | str]] = {
        "init": [tmp_path / "new"],
        "save": [tmp_path / "broken.ulg", "--out", tmp_path / "saved"],
        "study": [config / "studies" / "paper_table11.yaml", "--out", tmp_path / "sets"],
        "mission": [config / "missions" / "short_survey.yaml"],
        "decide": [made_results.path],
        "compare": [made_results.path, made_results.path],
    }
    status = main([command, *map(str, arguments[command]), "--json"])
    assert status == (1 if command == "save" else 0)
    captured = capsys.readouterr()
    assert captured.err == ""
    named = set(re.findall(r"`(\w+)`", manual_of(command, project_root)))
    assert keys_of(json.loads(captured.out)) - named == set()


def test_a_run_tells_what_the_manual_says(made_results: ResultsFolder, project_root: Path) -> None:
    document = run_outcome(made_results.path).document()
    assert keys_of(document) <= set(re.findall(r"`(\w+)`", manual_of("run", project_root)))
    assert (document["flights"], document["refused"], document["chosen"]) == (6, 1, "better")


def test_every_command_with_the_option_has_its_row(project_root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in COMMANDS:
        with pytest.raises(SystemExit):
            main([name, "--help"])
        if "--json" in capsys.readouterr().out.partition("examples:")[0]:
            assert manual_of(name, project_root)


def test_what_json_does_not_have_is_null_or_plain(capsys: pytest.CaptureFixture[str]) -> None:
    import numpy as np

    print_document({"a": float("nan"), "b": np.float64(1.5), "c": (Path("x"), np.bool_(True)), "d": [float("inf")]})
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": 1.5, "c": ["x", True], "d": [None]}
