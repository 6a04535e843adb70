"""Builds the package together with the pipeline's workflow and configuration.

Both lie at the top of the checkout, as Snakemake's standard layout has it; a wheel carries them within the package,
where `fusetune.running.workflow_files` finds them. All else about the package stands in `pyproject.toml`.

With FUSETUNE_KERNELS=1 the estimator is compiled, too, for a level of processors; the wheel is then one for this system
and this Python (`make wheel`).
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

TOP = Path(__file__).resolve().parent
CARRIED = ("workflow", "config")
WITHIN = Path("fusetune", "packaged")
WITH_KERNELS = os.environ.get("FUSETUNE_KERNELS") == "1"


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
        if self.editable_mode:
            return
        for name in carried_files():
            target = Path(self.build_lib, WITHIN, name)
            self.mkpath(str(target.parent))
            self.copy_file(str(TOP / name), str(target), preserve_mode=False)
        if WITH_KERNELS:
            package = os.path.abspath(self.build_lib)
            made = [
                sys.executable,
                "-m",
                "fusetune.ekf2.compiled.carried_kernels",
                str(Path(package, WITHIN, "kernels")),
            ]
            subprocess.run(made, env=os.environ | {"PYTHONPATH": package}, cwd=package, check=True)

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Files that are made, also those that are carried."""
        within = Path(self.build_lib, WITHIN)
        added = () if self.editable_mode else (file for file in within.rglob("*") if file.is_file())
        return [*super().get_outputs(include_bytecode), *map(str, added)]


class DistributionWithKernels(Distribution):
    """One for this system and this Python, where it carries machine code."""

    def has_ext_modules(self) -> bool:
        """Whether it does."""
        return WITH_KERNELS


setup(cmdclass={"build_py": BuildWithWorkflow}, distclass=DistributionWithKernels)
