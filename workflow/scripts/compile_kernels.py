"""Compile the estimator into the cache that all later jobs load it from, and the package's own modules to byte code."""

import compileall
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import fusetune
from fusetune.ekf2.replay.warm_up import compile_kernels
from fusetune.running.job import logged_job
from fusetune.storage.files import atomic_path

if TYPE_CHECKING:
    snakemake: Any

KEPT_CACHES = 5

with logged_job(snakemake.log[0]):
    # Where PYTHONDONTWRITEBYTECODE is set, every job would compile the package's modules again.
    compileall.compile_dir(Path(fusetune.__file__).parent, quiet=1)
    compile_kernels()
    ready = Path(snakemake.output[0])
    with atomic_path(ready) as temporary:
        temporary.write_text(json.dumps({"version": fusetune.__version__}) + "\n", encoding="utf-8")
    caches = sorted(ready.parents[1].iterdir(), key=lambda folder: folder.stat().st_mtime, reverse=True)
    for outdated in [folder for folder in caches if folder != ready.parent][KEPT_CACHES - 1 :]:
        shutil.rmtree(outdated, ignore_errors=True)
