"""Log after log compared with missions: one that cannot be read is told of, and the next one is taken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.analyze.conformance.conformance_files import conformance_document, rounded_figures
from fusetune.analyze.conformance.flown_track import flown_track
from fusetune.analyze.conformance.settings import DEFAULTS, ConformanceSettings
from fusetune.analyze.conformance.smoothed_track import smoothed_track
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.replaying.settings import WITHOUT_GAPS
from fusetune.design.missions.mission import Mission
from fusetune.errors import OF_DAMAGE, UserError
from fusetune.px4.ulog.reader import read_ulog
from fusetune.save.discovery import given_logs, log_error
from fusetune.save.verdict import judge
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class ConformedLog:
    """One log: `found` is as of `conformance_document`; None, and why in `error`, where the log cannot be read."""

    log: str
    found: dict[str, Any] | None = None
    error: UserError | None = None


def conformed_logs(
    paths: Sequence[AnyPath], missions: Sequence[Mission], settings: ConformanceSettings = DEFAULTS
) -> Iterator[ConformedLog]:
    """Compare logs with missions, each when it is asked for.

    Parameters
    ----------
    paths : logs, and folders that are searched for logs
    """
    for given in given_logs(paths):
        if given.error is not None:
            yield ConformedLog(given.shown, error=given.error)
        else:
            yield _conformed(Path(given.path), given.shown, missions, settings)


def _conformed(path: Path, shown: str, missions: Sequence[Mission], settings: ConformanceSettings) -> ConformedLog:
    try:
        observed = ObservedFlight(read_ulog(path), WITHOUT_GAPS)
        track = flown_track(observed.flight)
        if track is not None and not judge(observed.flight).reasons:
            track = smoothed_track(observed, track)
        found = conformance_document(observed.flight, track, missions, settings)
    except UserError as error:
        return ConformedLog(shown, error=error)
    except (OSError, *OF_DAMAGE) as error:
        return ConformedLog(shown, error=log_error(shown, error))
    return ConformedLog(shown, rounded_figures(found))
