"""Whether a flight can be replayed: named checks with figures, thresholds and remedies."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

from fusetune.errors import UserError
from fusetune.px4.flight import Flight
from fusetune.save.checks import aid_checks, flight_checks, imu_checks, log_checks, sensor_checks
from fusetune.save.checks.check import Check
from fusetune.save.thresholds import VerdictThresholds
from fusetune.time_limit import Deadline


@dataclass(frozen=True)
class Verdict:
    """Outcome of all checks of one flight."""

    flight: str
    checks: tuple[Check, ...]

    @property
    def status(self) -> Literal["replayable", "refused"]:
        """Refused when any check failed."""
        return "refused" if any(check.status == "fail" for check in self.checks) else "replayable"

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the flight is refused; empty for a replayable one."""
        return tuple(check.reason for check in self.checks if check.status == "fail")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What lessens the worth of the replay."""
        return tuple(check.reason for check in self.checks if check.status == "warning")

    def document(self) -> dict[str, Any]:
        """The verdict as a JSON object, in `verdict.json` and in `metadata.json`."""
        return {
            "flight": self.flight,
            "status": self.status,
            "reasons": list(self.reasons),
            "warnings": list(self.warnings),
            "checks": [asdict(check) for check in self.checks],
        }


def judge(flight: Flight, thresholds: VerdictThresholds | None = None, deadline: Deadline | None = None) -> Verdict:
    """Judge a flight that could be read, in the layout of `fusetune.px4.layouts.release_layouts.canonical`.

    Of the checks of the IMU those after a failed one are left out, since they would only say the same again; without
    IMU samples nothing but the log itself is judged.

    Raises
    ------
    TimeLimitError
        The deadline passed.
    """

    limits, deadline = thresholds or VerdictThresholds(), deadline or Deadline()
    checks = [check(flight, limits) for check in log_checks.CHECKS]
    checks.append(imu_checks.imu_present(flight))
    if checks[-1].status == "fail":
        return Verdict(flight.name, tuple(checks))
    for check in (*imu_checks.CHECKS, *sensor_checks.IMU_CHECKS):
        deadline.check()
        checks.append(check(flight, limits))
        if checks[-1].status == "fail":
            break
    checks += aid_checks.checks(flight, limits)
    for check in (*sensor_checks.AID_CHECKS, *flight_checks.CHECKS):
        deadline.check()
        checks.append(check(flight, limits))
    return Verdict(flight.name, tuple(checks))


def unreadable(name: str, error: UserError) -> Verdict:
    """Verdict on a log that cannot be read."""
    return Verdict(name, (Check("readable", "fail", f"the log {error.reason}", error.remedy),))
