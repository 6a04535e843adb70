"""Events of a run: as Snakemake's logger has them, as lines, and back."""

from __future__ import annotations

import logging

import pytest
from snakemake_interface_logger_plugins.common import LogEvent
from snakemake_interface_logger_plugins.registry import LoggerPluginRegistry

from fusetune.running.workflow_events import (
    Counted,
    Event,
    JobBegun,
    JobDone,
    JobFailed,
    Planned,
    Told,
    event_of,
    line_of,
)
from snakemake_logger_plugin_fusetune import LogHandler, event_told

JOB = {"jobid": 7, "rule_name": "save_flight", "wildcards": {"flight": "one"}}
RECORDS: list[tuple[dict, Event | None]] = [
    (
        {"event": LogEvent.RUN_INFO, "stats": {"all": 1, "save_flight": 3, "total": 4}},
        Planned({"all": 1, "save_flight": 3}),
    ),
    (
        {"event": LogEvent.JOB_INFO, "rule_msg": "Save: read one", **JOB},
        JobBegun(7, "save_flight", "Save: read one", "one"),
    ),
    ({"event": LogEvent.JOB_FINISHED, "job_id": 7}, JobDone(7)),
    ({"event": LogEvent.JOB_ERROR, "log": ["logs/one.log"], **JOB}, JobFailed(7, "save_flight", "one", "logs/one.log")),
    ({"event": LogEvent.JOB_ERROR, "log": [], **JOB}, JobFailed(7, "save_flight", "one", "")),
    ({"event": LogEvent.PROGRESS, "done": 3, "total": 9}, Counted(3, 9)),
    ({"event": LogEvent.ERROR, "msg": "no such rule", "levelno": logging.ERROR}, Told("no such rule", is_error=True)),
    ({"msg": "Building DAG of jobs...", "levelno": logging.INFO}, Told("Building DAG of jobs...", is_error=False)),
    ({"event": LogEvent.SHELLCMD, "msg": "Shell command: None"}, None),
]


@pytest.mark.parametrize(("record", "event"), RECORDS)
def test_a_record_of_the_logger_is_an_event_and_comes_through_a_pipe(record: dict, event: Event | None) -> None:
    told = event_told(logging.makeLogRecord(record))
    assert told == event
    if told is not None:
        line = line_of(told)
        assert line.endswith("\n")
        assert line.count("\n") == 1
        assert event_of(line) == event


@pytest.mark.parametrize(
    "line", ["Save: read one", "", "\x1e{", '\x1e{"event": "JobDone"}', '\x1e{"event": "None"}', "\x1e[]"]
)
def test_what_is_no_event_is_none(line: str) -> None:
    assert event_of(line) is None


def test_snakemake_finds_the_plugin_by_its_name() -> None:
    plugin = LoggerPluginRegistry().get_plugin("fusetune")
    assert plugin.log_handler is LogHandler
