"""The command `fusetune`: the whole pipeline and single steps of it, one file for each sub-command."""

from fusetune.cli.command_line import main

__all__ = ["main"]
