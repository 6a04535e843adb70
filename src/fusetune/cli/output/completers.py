"""What a shell completes: sub-commands and options by the parser, files by their suffix, parameters by their names.

argcomplete asks a process of ours, once for each TAB, so nothing heavier than what is asked for is loaded.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable

_SUFFIX = re.compile(r"\.(ulg|yaml|params|plan|png|html|pdf)\b")
_OF_NAMES = {
    "LOG": ("ulg",),
    "LOG|RESULTS": ("ulg",),
    "STUDY_OR_PARAMS": ("yaml", "params"),
    "MISSION": ("yaml", "plan"),
    "BEST_PARAMS": ("params",),
    "BACKUP": ("params",),
}
"""Names of arguments that say no suffix themselves → suffixes."""
_FOLDERS = ("DIR", "RESULTS", "A", "B")
_PARAMETERS = {"NAME:KEY=VALUE,…": "=", "NAME=VALUE,…": "=", "NAMES": ""}
"""Arguments that hold names of parameters → what follows one."""
_SETTINGS = ("KEY=VALUE",)


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer what the shell asks, and end the process."""
    import argcomplete

    argcomplete.autocomplete(parser, always_complete_options="long", default_completer=complete_argument)  # type: ignore[arg-type]


def complete_argument(prefix: str, action: argparse.Action, **given: object) -> Iterable[str]:
    """What an argument that begins like this may be, by what the help calls it."""
    from argcomplete.completers import DirectoriesCompleter, FilesCompleter

    name = action.metavar if isinstance(action.metavar, str) else ""
    if name in _PARAMETERS:
        return _parameters(prefix, _PARAMETERS[name])
    if name in _SETTINGS:
        return _settings(prefix)
    if name in _FOLDERS or name.endswith("_DIR"):
        return list(DirectoriesCompleter()(prefix))
    suffixes = _OF_NAMES.get(name) or tuple(_SUFFIX.findall(name))
    if suffixes or "FILE" in name:
        return list(FilesCompleter(suffixes)(prefix))
    return []


def _parameters(prefix: str, then: str) -> list[str]:
    """Names of parameters, where one may begin: at first, behind `NAME:` or behind a comma."""
    from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

    head = prefix[: max(prefix.rfind(":"), prefix.rfind(",")) + 1]
    return [f"{head}{name}{then}" for name in PARAMETERS if f"{head}{name}".startswith(prefix)]


def _settings(prefix: str) -> list[str]:
    """Keys of the configuration."""
    from fusetune.configuration import Configuration
    from fusetune.settings.schema import schema_of

    keys = []
    for name, of_it in schema_of(Configuration)["properties"].items():
        keys += [f"{name}.{key}=" for key in of_it.get("properties", ())] or [f"{name}="]
    return [key for key in keys if key.startswith(prefix)]
