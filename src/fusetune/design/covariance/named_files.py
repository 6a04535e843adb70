"""Which files a design is made of; read when the workflow starts, so it brings no numerics."""

from __future__ import annotations

from fusetune.running.workflow_files import file_or_packaged
from fusetune.settings.yaml_reader import read_yaml
from fusetune.storage.files import AnyPath

_NAMES = ("mission", "vehicle", "log")


def files_of_design(path: AnyPath) -> tuple[str, ...]:
    """The design's own file, and those of the way that it names.

    Raises
    ------
    UserError
        The design cannot be read.
    """
    document = read_yaml(path)
    named = (document.get(name) for name in _NAMES)
    return (str(path), *(file_or_packaged(name) for name in named if isinstance(name, str) and name))
