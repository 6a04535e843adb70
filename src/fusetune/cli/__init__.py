"""The command `fusetune`: single steps of the pipeline on single files, one file for each sub-command."""

from fusetune.cli.command_line import main

__all__ = ["main"]
