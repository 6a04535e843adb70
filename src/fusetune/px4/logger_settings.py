"""The settings of PX4's logger: what it logs and when.

https://docs.px4.io/main/en/advanced_config/parameter_reference.html#sd-logging
"""

from __future__ import annotations

import math
from collections.abc import Mapping

DEFAULT_SET_BIT, ESTIMATOR_REPLAY_BIT = 0b01, 0b10
"""Bits of SDLOG_PROFILE."""

WHEN_ARMED, FROM_BOOT_TO_DISARMING, FROM_BOOT = 0, 1, 2
MODES = {
    WHEN_ARMED: "while armed",
    FROM_BOOT_TO_DISARMING: "from boot to disarming",
    FROM_BOOT: "from boot to shutdown",
    3: "by a switch",
    4: "from first arming to shutdown",
}
"""Values of SDLOG_MODE."""

PROFILE_FOR_REPLAY = DEFAULT_SET_BIT | ESTIMATOR_REPLAY_BIT
SET_LOG_FROM_BOOT = f"SDLOG_MODE = {FROM_BOOT} (log {MODES[FROM_BOOT]})"
"""With 1, a second flight without a restart would be logged from arming on only."""
SET_LOG_EVERY_SAMPLE = f"SDLOG_PROFILE = {PROFILE_FOR_REPLAY} (default set and estimator replay: every sample)"


def logging_profile_of(settings: Mapping[str, float]) -> int:
    """SDLOG_PROFILE; 0 where it is missing or damaged."""
    return _whole(settings.get("SDLOG_PROFILE"))


def logging_mode_of(settings: Mapping[str, float]) -> int | None:
    """SDLOG_MODE; None where it is missing."""
    mode = settings.get("SDLOG_MODE")
    return None if mode is None else _whole(mode)


def logs_from_boot(settings: Mapping[str, float]) -> bool:
    """Whether every flight's log begins when the autopilot starts."""
    return logging_mode_of(settings) == FROM_BOOT


def _whole(value: float | None) -> int:
    return int(value) if value is not None and math.isfinite(value) else 0
