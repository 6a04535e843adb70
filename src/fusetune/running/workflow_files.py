"""Where the pipeline's own files lie: its Snakefile, and the configuration that it has where a folder has none.

In a checkout both lie at its top, where Snakemake and its catalogue look for them. An installed package carries the
same tree in its folder `packaged`, which `setup.py` fills when the package is built.
"""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def checkout() -> Path | None:
    """The folder of the checkout that this package is imported from; `None` where it is installed."""
    top = PACKAGE.parents[1]
    return top if PACKAGE.parent.name == "src" and (top / "workflow" / "Snakefile").is_file() else None


def pipeline_folder() -> Path:
    """The folder that holds `workflow/` and `config/`: the checkout, or the package's own."""
    return checkout() or PACKAGE / "packaged"


def workflow_file() -> Path:
    """The Snakefile of the pipeline, as `snakemake --snakefile` takes it."""
    return pipeline_folder() / "workflow" / "Snakefile"


def packaged_config() -> Path:
    """The folder `config/` that comes with the pipeline: `config.yaml` with all defaults, studies, missions …"""
    return pipeline_folder() / "config"


def file_or_packaged(name: str) -> str:
    """A file or folder that a configuration names: in the working folder, else among those that come with the pipeline.

    A name of neither stays as it is, for the error that tells of it.
    """
    parts, packaged = Path(name).parts, pipeline_folder() / name
    comes_with_it = parts[:1] == ("config",) and ".." not in parts and packaged.exists()
    return str(packaged) if comes_with_it and not Path(name).exists() else name
