"""Why a run failed, in a sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusetune.running.run_failures import RunFailures
from fusetune.running.workflow_events import Event, JobFailed, Told

SENTENCE = "results/save/one: is damaged. Delete it and run again."
FAULT = "Traceback (most recent call last):\n  File \"x.py\", line 1, in f\nKeyError: 'present'\n"
OF_SNAKEMAKE = (
    'WorkflowError in file "rules/configuration.smk", line 27:\n--config: seed is -3. Mend it.\n'
    '  File "rules/configuration.smk", line 14, in told_in_one_line'
)


def failed(rule: str = "save_flight", log: str = "save.log") -> JobFailed:
    return JobFailed(1, rule, "one", log)


@pytest.mark.parametrize(
    ("told", "log", "sentences"),
    [
        ([failed(), failed()], f"{SENTENCE}\n", [SENTENCE]),
        ([SENTENCE, failed(), Told("Exiting because a job execution failed. Look above.", True)], SENTENCE, [SENTENCE]),
        ([Told(OF_SNAKEMAKE, True)], "", ["--config: seed is -3. Mend it."]),
        ([Told(f"{FAULT.strip()}", True)], "", ["'present'"]),
        (["Waiting ...", "work: another run is at work here."], "", ["work: another run is at work here."]),
        ([], "", ["Snakemake ended without a reason"]),
    ],
)
def test_the_reason_is_told_once(told: list[Event | str], log: str, sentences: list[str], tmp_path: Path) -> None:
    (tmp_path / "save.log").write_text(log, encoding="utf-8")
    failures = RunFailures(tmp_path)
    for one in told:
        failures.take(one)
    assert failures.sentences() == sentences


def test_a_fault_of_ours_is_told_as_one_with_its_log(tmp_path: Path) -> None:
    (tmp_path / "save.log").write_text(FAULT, encoding="utf-8")
    failures = RunFailures(tmp_path)
    failures.take(failed())
    failures.take(failed(log="none.log"))
    ours, nothing = failures.sentences()
    assert ours.startswith("save_flight of one failed by a fault of fusetune's own (KeyError: 'present'). ")
    assert "save.log" in ours
    assert nothing.startswith("save_flight of one failed and left no word of why.")
