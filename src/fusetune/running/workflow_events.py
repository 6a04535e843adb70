"""What a run of the workflow tells of itself while it works, for the process that started it.

Snakemake tells its logger plugin `fusetune` (the package `snakemake_logger_plugin_fusetune`); that writes each event as
a line of JSON to standard error, behind a sign that no other line begins with (RFC 7464). So what jobs and the workflow
print themselves comes in order with the events, through one pipe.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

RECORD = "\x1e"
"""Begins a line that is an event."""


@dataclass(frozen=True)
class Planned:
    """Jobs are planned.

    Attributes
    ----------
    jobs : rule → how many of its jobs there are in all, those that are done among them
    """

    jobs: Mapping[str, int]


@dataclass(frozen=True)
class JobBegun:
    """A job begins; in a dry run it would.

    Attributes
    ----------
    number : Snakemake's, by which its end is told
    words : what it does, as its rule says
    flight : that it is about; empty where it is about all
    """

    number: int
    rule: str
    words: str
    flight: str


@dataclass(frozen=True)
class JobDone:
    """A job has ended well."""

    number: int


@dataclass(frozen=True)
class JobFailed:
    """A job has ended otherwise.

    Attributes
    ----------
    log : file that it wrote its reason to; empty where it has none
    """

    number: int
    rule: str
    flight: str
    log: str


@dataclass(frozen=True)
class Counted:
    """How many jobs are done, and how many there are as far as is known."""

    done: int
    total: int


@dataclass(frozen=True)
class Told:
    """A sentence of Snakemake's own, or what it says of an exception.

    Attributes
    ----------
    is_error : whether something went wrong
    """

    text: str
    is_error: bool


Event = Planned | JobBegun | JobDone | JobFailed | Counted | Told

_KINDS = {kind.__name__: kind for kind in (Planned, JobBegun, JobDone, JobFailed, Counted, Told)}


def line_of(event: Event) -> str:
    """An event as a line, its end included."""
    return f"{RECORD}{json.dumps({'event': type(event).__name__, **asdict(event)})}\n"


def event_of(line: str) -> Event | None:
    """The event that a line tells; None where it is something else that was printed."""
    if not line.startswith(RECORD):
        return None
    try:
        told = json.loads(line[len(RECORD) :])
        kind = _KINDS[told["event"]]
        return kind(**{one.name: told[one.name] for one in fields(kind)})
    except (ValueError, KeyError, TypeError):  # two processes wrote at once
        return None
