"""The diagnosis of log after log: one that cannot be read is told of, and the next one is taken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.analyze.diagnosis.diagnose import diagnose
from fusetune.analyze.diagnosis.diagnosis import Diagnosis
from fusetune.analyze.diagnosis.experiments import AT_MOST
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.replaying.settings import WITHOUT_GAPS as AS_FLOWN
from fusetune.errors import OF_DAMAGE, UserError
from fusetune.finding import Finding, of_severity
from fusetune.px4.ulog.reader import read_ulog
from fusetune.save.discovery import given_logs, log_error
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class DiagnosedLog:
    """One log.

    Attributes
    ----------
    log : as it can be printed
    found : what is wrong, what explains most first
    start_us, stop_us : of the log, µs since boot
    not_replayed : why there is no replay, in words, and the rules that ask for one said nothing; empty where there is
    error : why it could not be read, else None
    """

    log: str
    found: tuple[Diagnosis, ...] = ()
    start_us: int = 0
    stop_us: int = 0
    not_replayed: tuple[str, ...] = ()
    error: UserError | None = None

    def document(self) -> dict[str, Any]:
        """As JSON holds it."""
        document: dict[str, Any] = {"log": self.log, "duration_s": round((self.stop_us - self.start_us) * 1e-6, 3)}
        document["error"] = None if self.error is None else {"reason": self.error.reason, "remedy": self.error.remedy}
        document["not_replayed"] = list(self.not_replayed)
        document["findings"] = [one.document(self.start_us) for one in self.found]
        return document


def diagnosed_logs(paths: Sequence[AnyPath], experiments: int = AT_MOST) -> Iterator[DiagnosedLog]:
    """Diagnose logs one after the other, each when it is asked for.

    Parameters
    ----------
    paths : logs, and folders that are searched for logs
    experiments : as for `diagnose`
    """
    for given in given_logs(paths):
        if given.error is not None:
            yield DiagnosedLog(given.shown, error=given.error)
        else:
            yield _diagnosed(Path(given.path), given.shown, experiments)


def _diagnosed(path: Path, shown: str, experiments: int) -> DiagnosedLog:
    refused: tuple[Finding, ...] = ()
    try:
        flight = read_ulog(path)
        observed = ObservedFlight(flight, AS_FLOWN)
        verdict = observed.verdict
        refused = of_severity(verdict.findings, "fail")
        found, why_not = diagnose(observed, experiments), verdict.reasons
    except UserError as error:
        return DiagnosedLog(shown, error=error)
    except OSError as error:
        return DiagnosedLog(shown, error=log_error(shown, error))
    except OF_DAMAGE as error:
        if refused:
            return DiagnosedLog(shown, error=_untold(shown, refused))
        return DiagnosedLog(shown, error=log_error(shown, error))
    return DiagnosedLog(shown, found, flight.start_timestamp, flight.last_timestamp, why_not)


def _untold(shown: str, refused: Sequence[Finding]) -> UserError:
    """A log that can be read and tells nothing, for the reason why it is not replayed."""
    reasons = "; ".join(one.found for one in refused)
    remedies = ". ".join(dict.fromkeys(one.remedy for one in refused if one.remedy))
    return UserError(shown, f"tells nothing of what is wrong: {reasons}", remedies or "Log the flight again")
