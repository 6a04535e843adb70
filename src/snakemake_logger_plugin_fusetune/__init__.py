"""Snakemake's logger plugin `fusetune`: tells what a run does as events (`fusetune.running.workflow_events`).

`fusetune run` starts Snakemake with it; Snakemake finds plugins by the names of top-level packages.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
from typing import Any

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from fusetune.running.workflow_events import Counted, Event, JobBegun, JobDone, JobFailed, Planned, Told, line_of


def event_told(record: Any) -> Event | None:
    """The event that a record of Snakemake's logger is; None for one that nobody waits for."""
    kind = getattr(record, "event", None)
    if kind == LogEvent.RUN_INFO:
        return Planned({rule: count for rule, count in record.stats.items() if rule != "total"})
    if kind == LogEvent.JOB_INFO:
        return JobBegun(record.jobid, record.rule_name, record.rule_msg or record.rule_name, _flight(record))
    if kind == LogEvent.JOB_FINISHED:
        return JobDone(record.job_id)
    if kind == LogEvent.JOB_ERROR:
        return JobFailed(record.jobid, record.rule_name, _flight(record), str(next(iter(record.log or ()), "")))
    if kind == LogEvent.PROGRESS:
        return Counted(record.done, record.total)
    if kind in (None, LogEvent.ERROR) and record.msg:
        return Told(record.getMessage(), kind is not None or record.levelno >= logging.ERROR)
    return None


def _flight(record: Any) -> str:
    return str((getattr(record, "wildcards", None) or {}).get("flight", ""))


class LogHandler(LogHandlerBase):
    """Writes events to standard error."""

    _is_alone = False

    def emit(self, record: logging.LogRecord) -> None:
        """Write one; who asked for the run and is gone takes it along."""
        event = event_told(record)
        if event is not None and not self._is_alone:
            try:
                sys.stderr.write(line_of(event))
                sys.stderr.flush()
            except OSError:
                self._is_alone = True
                os.kill(os.getpid(), signal.SIGTERM)

    @property
    def writes_to_stream(self) -> bool:
        """It stands for what Snakemake prints itself."""
        return True

    @property
    def writes_to_file(self) -> bool:
        """Snakemake's own log stays as it is."""
        return False

    @property
    def has_filter(self) -> bool:
        """It takes all."""
        return True

    @property
    def has_formatter(self) -> bool:
        """It formats nothing."""
        return True

    @property
    def needs_rulegraph(self) -> bool:
        """It does not."""
        return False
