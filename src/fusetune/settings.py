"""Sections of the configuration as dataclasses whose fields declare default, range, unit and meaning."""

from collections.abc import Mapping
from dataclasses import field, fields
from typing import Any, TypeVar

from fusetune.errors import UserError
from fusetune.storage.files import AnyPath

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
