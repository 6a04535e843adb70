"""Builds the package together with the pipeline's workflow and configuration.

Both lie at the top of the checkout, as Snakemake's standard layout has it; a wheel carries them within the package,
where `fusetune.running.workflow_files` finds them. All else about the package stands in `pyproject.toml`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

TOP = Path(__file__).resolve().parent
CARRIED = ("workflow", "config")
WITHIN = Path("fusetune", "packaged")


def carried_files() -> Iterator[Path]:
    """Files of the workflow and the configuration, relative to the checkout."""
    for folder in CARRIED:
        for file in sorted((TOP / folder).rglob("*")):
            name = file.relative_to(TOP)
            if (
                file.is_file()
                and "__pycache__" not in name.parts
                and not any(one.startswith(".") for one in name.parts)
            ):
                yield name


class BuildWithWorkflow(build_py):
    """Copies them into the package that is built; an editable installation uses those of the checkout."""

    def run(self) -> None:
        """Build the package, then add to it."""
        super().run()
        for name in () if self.editable_mode else carried_files():
            target = Path(self.build_lib, WITHIN, name)
            self.mkpath(str(target.parent))
            self.copy_file(str(TOP / name), str(target), preserve_mode=False)

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Files that are made, also those that are carried."""
        made = super().get_outputs(include_bytecode)
        return (
            made
            if self.editable_mode
            else [*made, *(str(Path(self.build_lib, WITHIN, name)) for name in carried_files())]
        )


setup(cmdclass={"build_py": BuildWithWorkflow})
