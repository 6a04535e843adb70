"""A diagnosis as a pilot reads it: what is wrong, since when, how sure, why, what to do."""

from __future__ import annotations

from collections.abc import Iterator

from fusetune.analyze.diagnosis.diagnosed_logs import DiagnosedLog
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, how_sure

LABELS = {"fail": "FAIL", "warning": "warning", "note": "note"}


def log_lines(one: DiagnosedLog) -> Iterator[str]:
    """What was found on one log, line by line."""
    if one.error is not None:
        yield f"{one.log}: {one.error.reason}. {one.error.remedy}."
        return
    if one.found:
        yield f"{one.log}:"
    else:
        yield f"{one.log}: nothing found" + (
            ", and too little known to say that nothing is wrong" if one.not_replayed else ""
        )
    if one.not_replayed:
        yield f"  not replayed, so less can be told: {'; '.join(one.not_replayed)}"
    for found in one.found:
        yield from _lines(found, one)


def _lines(found: Diagnosis, one: DiagnosedLog) -> Iterator[str]:
    since, until = ((time - one.start_us) * 1e-6 for time in (found.start_us, found.stop_us))
    how = how_sure(found.confidence)
    yield f"  {LABELS[found.severity]}: {found.cause} [{found.id}]"
    yield f"    when: from {since:.0f} s to {until:.0f} s of the log; {how} ({found.confidence:.0%})"
    for sign in found.signs:
        yield f"    why: {sign.words}"
    if found.trial is not None:
        yield f"    tried: {found.trial.words}"
    yield f"    do: {found.remedy}"
