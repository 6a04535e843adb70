"""Whether a flight can be replayed: what its checks found, with figures, thresholds and remedies.

Which checks there are is said in `fusetune.save.checks.registry`, what each asks in the file that is named for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from fusetune.check import Check
from fusetune.errors import UserError
from fusetune.finding import Finding, documents, of_severity
from fusetune.px4.flight import Flight
from fusetune.px4.releases import AUTO
from fusetune.save.checks import registry
from fusetune.save.checks.judged_flight import JudgedFlight
from fusetune.save.thresholds import VerdictThresholds
from fusetune.storage.files import AnyPath
from fusetune.time_limit import Deadline


@dataclass(frozen=True)
class Verdict:
    """What all checks of one flight found."""

    flight: str
    findings: tuple[Finding, ...]

    @property
    def status(self) -> Literal["replayable", "refused"]:
        """Refused when any check failed."""
        return "refused" if self.failures else "replayable"

    @property
    def failures(self) -> tuple[Finding, ...]:
        """For what the flight is refused; empty for a replayable one."""
        return of_severity(self.findings, "fail")

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the flight is refused, in words."""
        return tuple(finding.found for finding in self.failures)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What lessens the worth of the replay, in words."""
        return tuple(finding.found for finding in of_severity(self.findings, "warning"))

    def demand_replayable(self, file: AnyPath) -> None:
        """Raise `UserError` about the log, with every reason and remedy, where it cannot be replayed."""
        if self.failures:
            remedies = dict.fromkeys(finding.remedy for finding in self.failures if finding.remedy)
            reason = f"cannot be replayed: {'; '.join(self.reasons)}"
            raise UserError(file, reason, ". ".join(remedies) or "Log the flight again")

    def document(self) -> dict[str, Any]:
        """The verdict as a JSON object, in `verdict.json` and in `metadata.json`."""
        return {
            "flight": self.flight,
            "status": self.status,
            "reasons": list(self.reasons),
            "warnings": list(self.warnings),
            "findings": documents(self.findings),
        }


def judge(
    flight: Flight,
    thresholds: VerdictThresholds | None = None,
    deadline: Deadline | None = None,
    release: str = AUTO,
) -> Verdict:
    """Judge a flight that could be read, in the layout of `fusetune.px4.layouts.release_layouts.canonical`.

    Of the checks of the IMU those after a failed one are left out, since they would only say the same again; without
    IMU samples nothing but the log itself is judged.

    Parameters
    ----------
    release : whose estimator is asked to replay it, as in the configuration

    Raises
    ------
    TimeLimitError
        The deadline passed.
    """
    judged = JudgedFlight(flight, thresholds or VerdictThresholds(), release)
    deadline = deadline or Deadline()
    findings = _asked((*registry.OF_THE_LOG, registry.NEEDED), judged, deadline)
    if findings[-1].severity != "fail":
        findings += _asked(registry.OF_THE_IMU, judged, deadline, until_failed=True)
        findings += _asked(registry.OF_THE_FLIGHT, judged, deadline)
    return Verdict(flight.name, tuple(findings))


def _asked(
    checks: Sequence[Check[JudgedFlight]], judged: JudgedFlight, deadline: Deadline, *, until_failed: bool = False
) -> list[Finding]:
    """What some checks find."""
    findings: list[Finding] = []
    for check in checks:
        deadline.check()
        findings += check.findings(judged)
        if until_failed and of_severity(findings, "fail"):
            break
    return findings


def unreadable(name: str, error: UserError) -> Verdict:
    """Verdict on a log that cannot be read."""
    return Verdict(name, (Finding("readable", "fail", f"the log {error.reason}", error.remedy),))
