"""What is told of public logs, beside what is known of them: the table of docs/diagnosis.md.

    python -m benchmarks.diagnosed_logs LOGS_DIR                       # prints the table
    python -m benchmarks.diagnosed_logs LOGS_DIR docs/diagnosis.md     # puts it there

LOGS_DIR holds ULog files named owner__name.ulg; of those that stand in `KNOWN` it is said whether the diagnosis agrees.
The status is 1 where one does not. CPU is that of the whole diagnosis in one process, with everything imported.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.decision_study.tables import between_marks

from fusetune.analyze.diagnosis.diagnosed_logs import DiagnosedLog, diagnosed_logs
from fusetune.analyze.diagnosis.diagnosis import Diagnosis
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
from fusetune.errors import UserError
from fusetune.px4.ulog.reader import read_ulog

TABLE = "logs"
FIRST = "SkyRats__log_7_2021-8-12-15-49-54"
"""Asked twice, for the first answer of a process compiles and imports."""


@dataclass(frozen=True)
class Known:
    """What is known of a log by those who collected it.

    Attributes
    ----------
    words : in words
    causes : of which one stands first; empty where no cause is known
    is_sound : that there is no failure
    is_refused : that it cannot be replayed
    """

    words: str
    causes: frozenset[str] = frozenset()
    is_sound: bool = False
    is_refused: bool = False

    def agrees(self, one: DiagnosedLog) -> bool | None:
        """Whether the diagnosis says as much; None where nothing is known that it could say."""
        if not (self.causes or self.is_sound or self.is_refused):
            return None
        if self.is_refused and one.error is None and not one.not_replayed:
            return False
        if self.is_sound and any(found.severity == "fail" for found in one.found):
            return False
        return not self.causes or (bool(one.found) and one.found[0].id in self.causes)


_AGREES = {True: "yes", False: "**no**", None: "–"}
_COMPASS = frozenset({"magnetic_disturbance", "motor_magnetic_field", "magnetometer_rotated", "magnetometer_scale"})
_SOUND = Known("sound", is_sound=True)
_MADE = Known("made by a simulation, sound", is_sound=True)
_TURNED = Known("magnetometer a quarter turn off", frozenset({"magnetometer_rotated"}))
_FIX = frozenset({"gnss_loss"})
KNOWN = {
    "Auterion__corrupt_format_not_utf8": Known("damaged: a format that is no text", is_refused=True),
    "Auterion__corrupt_unregistered_msg_id": Known("a damaged record; GNSS at 0.6 Hz", _FIX),
    "Auterion__quadrotor_local": Known("GNSS never has a fix", _FIX, is_refused=True),
    "Chainplain__log_9": Known("clipping, instances switch", frozenset({"accelerometer_clipping", "instance_whipsaw"})),
    "FSYR-H__log_61": Known("strong vibration, missing IMU rows", frozenset({"vibration", "imu_gaps"})),
    "JAParedes__TestFlight1": _SOUND,
    "PX4__ekf_failure": Known("roll failure, clipping, filter faults", frozenset({"accelerometer_clipping"})),
    "PX4__gps_interference": Known("GNSS never has a fix", _FIX | {"gnss_interference"}),
    "PX4__sample_log_small": Known("6.5 s long", is_refused=True),
    "PX4__sample_multi_ekf_default_params": Known("simulated, three estimator instances"),
    "Parham-Oveissi__log_40": _SOUND,
    **{f"SkyRats__log_{number}_2021-8": _SOUND for number in (7, 8, 9, 10, 13, 16, 17)},
    "SkyRats__log_3_2021-5": _SOUND,
    "SkyRats__log_28": Known("magnetometer and heading at fault", _COMPASS | {"yaw_alignment"}),
    "SkyRats__log_29": Known("magnetometer and heading at fault", _COMPASS | {"yaw_alignment"}),
    "YevheniiKovryzhenko__log_16": Known("IMU logged at 20 Hz", frozenset({"imu_gaps"}), is_refused=True),
    "erdemarslan380__sitl": _TURNED,
    "mengchaoheng__test3": Known("gaps of the IMU", frozenset({"imu_gaps"})),
    "pypi__sample_appended": Known("an old format, on a bench"),
    "synthetic__mc_range": Known("made by a simulation, a step of the terrain", frozenset({"range_step"})),
    "synthetic__": _MADE,
}
"""Beginning of a log's name → what is known; the longest that fits counts."""


def known_of(name: str) -> Known | None:
    """What is known of a log; None of others."""
    fitting = [start for start in KNOWN if name.startswith(start)]
    return KNOWN[max(fitting, key=len)] if fitting else None


def row(log: Path, one: DiagnosedLog, cpu_s: float) -> str:
    """A line of the table."""
    known = known_of(log.stem)
    agrees = _AGREES[known.agrees(one) if known is not None else None]
    replay = "cannot be read" if one.error is not None else "refused" if one.not_replayed else "yes"
    first, *others = [_in_short(found) for found in one.found] or ["–"]
    words = known.words if known is not None else "–"
    cells = (log.stem, _release(log), replay, first, ", ".join(others) or "–", words, agrees, f"{cpu_s:.2f}")
    return "| " + " | ".join(cells) + " |"


def _in_short(found: Diagnosis) -> str:
    return f"`{found.id}` {found.severity} {found.confidence:.2f}"


def _release(log: Path) -> str:
    try:
        return read_ulog(log).release_name
    except UserError:
        return "unknown"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.diagnosed_logs",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("logs", type=Path)
    parser.add_argument("document", type=Path, nargs="?")
    options = parser.parse_args(arguments)
    use_kernel_cache()
    logs = sorted(options.logs.glob("*.ulg"))
    if not logs:
        parser.error(f"{options.logs} holds no log")
    list(diagnosed_logs([next((log for log in logs if log.stem == FIRST), logs[0])]))
    lines = ["| log | release | replayed | first | others | known | agrees | CPU, s |", "|" + "---|" * 8]
    for log in logs:
        before = time.process_time()
        (one,) = diagnosed_logs([log])
        lines.append(row(log, one, time.process_time() - before))
        if options.document is None:
            print(*(lines if len(lines) == 3 else lines[-1:]), sep="\n", flush=True)
    if options.document is not None:
        text = options.document.read_text(encoding="utf-8")
        options.document.write_text(between_marks(text, TABLE, "\n".join(lines)), encoding="utf-8")
    return int(any("**no**" in line for line in lines))


if __name__ == "__main__":
    raise SystemExit(main())
