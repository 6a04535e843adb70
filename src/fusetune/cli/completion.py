"""`fusetune completion`."""

from __future__ import annotations

import argparse

from fusetune.cli.command import DONE

HELP = "print what lets a shell complete commands, options, files and parameters"
EXAMPLES = (
    ('eval "$(fusetune completion bash)"', "in ~/.bashrc"),
    ('eval "$(fusetune completion zsh)"', "in ~/.zshrc, after compinit"),
    ("fusetune completion fish > ~/.config/fish/completions/fusetune.fish", "once"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The shell."""
    parser.add_argument("shell", choices=("bash", "zsh", "fish"))


def run(options: argparse.Namespace) -> int:
    """Print it; always `DONE`."""
    from argcomplete import shellcode

    print(shellcode(["fusetune"], shell=options.shell))
    return DONE
