"""How a flight is scored: the window, the cuts and the blocks; read from the section `scoring` of the configuration."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

from fusetune.errors import UserError
from fusetune.files import AnyPath

Settings = TypeVar("Settings")


def setting(default: Any, minimum: float | None, maximum: float | None, unit: str, meaning: str) -> Any:
    """Declare one value of a settings dataclass with the range that `settings_from_mapping` enforces."""
    return field(default=default, metadata={"minimum": minimum, "maximum": maximum, "unit": unit, "meaning": meaning})


def settings_from_mapping(
    kind: type[Settings], values: Mapping[str, Any] | None, section: str, file: AnyPath
) -> Settings:
    """Build a settings dataclass from a section of the configuration.

    Raises
    ------
    UserError
        For a key that does not exist, a value of the wrong type or one out of its range.
    """
    values = dict(values or {})
    known = {item.name: item for item in fields(kind)}  # type: ignore[arg-type]
    for name in sorted(set(values) - set(known)):
        raise UserError(file, f"{section}.{name} is not a setting", f"Use one of: {', '.join(sorted(known))}")
    for name, value in values.items():
        values[name] = _checked(known[name], value, section, file)
    return kind(**values)


def _checked(item: Any, value: Any, section: str, file: AnyPath) -> Any:
    expected = type(item.default)
    if expected is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if not isinstance(value, expected) or (isinstance(value, bool) and expected is not bool):
        raise UserError(
            file,
            f"{section}.{item.name} is {value!r}, expected a value of type {expected.__name__}",
            f"Its default is {item.default!r} {item.metadata.get('unit', '')}".rstrip(),
        )
    low, high = item.metadata.get("minimum"), item.metadata.get("maximum")
    if (low is not None and not value >= low) or (high is not None and not value <= high):
        raise UserError(
            file,
            f"{section}.{item.name} is {value!r}, outside {low} to {high} {item.metadata.get('unit', '')}".rstrip(),
            f"Choose a value inside the range; the default is {item.default!r}",
        )
    return value


@dataclass(frozen=True)
class ScoringSettings:
    """What is scored of a flight. The same rules hold for all parameter sets of the flight."""

    settle_s: float = setting(5.0, 0.0, 60.0, "s", "time after aiding starts that is not scored")
    warm_settle_s: float = setting(1.0, 0.0, 60.0, "s", "the same after a warm start")
    reset_cut_s: float = setting(3.0, 0.0, 30.0, "s", "time after a reset or a gap in the log that is not scored")
    log_gap_s: float = setting(0.25, 0.05, 5.0, "s", "an IMU gap longer than this is cut like a reset")
    block_s: float = setting(10.0, 2.0, 60.0, "s", "length of the blocks that the bootstrap draws")
    window_s: float = setting(30.0, 5.0, 300.0, "s", "length of the windows of which the worst is reported")
    minimum_scored_s: float = setting(5.0, 1.0, 600.0, "s", "a flight with less than this is not scored")
    max_start_delay_s: float = setting(10.0, 0.0, 120.0, "s", "a set that starts aiding this much later is excluded")
    confidence: float = setting(0.95, 0.5, 0.999, "", "level of all intervals and bounds")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any] | None, file: AnyPath = "config/config.yaml") -> "ScoringSettings":
        """Read the section `scoring`; a missing section or key means the default."""
        return settings_from_mapping(cls, values, "scoring", file)
