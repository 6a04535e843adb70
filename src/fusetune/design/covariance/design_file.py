"""Reading a design of either kind."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Literal

from fusetune.design.covariance.ekf2_design import Ekf2Design, ekf2_design
from fusetune.design.covariance.linear_design import LinearDesign, linear_design
from fusetune.design.names import name_problem
from fusetune.settings.checking import raise_problems, validate
from fusetune.settings.declaration import required
from fusetune.settings.schema import schema_of
from fusetune.settings.yaml_reader import read_yaml
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class _Kind:
    kind: Literal["linear", "ekf2"] = required("a linear model, or EKF2 along a track")


def load_design(path: AnyPath) -> LinearDesign | Ekf2Design:
    """Read and check a design.

    Raises
    ------
    UserError
        Names every key at fault with what was found and what was expected.
    """
    document, file = read_yaml(path), Path(path)
    validate({key: document[key] for key in document if key == "kind"}, schema_of(_Kind), file)
    design = linear_design(document, file) if document["kind"] == "linear" else ekf2_design(document, file)
    problem = name_problem(design.name)
    raise_problems(file, [f"name: {problem}"] if problem else [], "Choose another name")
    names = [variation.name for variation in design.variations]
    names += [sweep.name for sweep in design.sweeps]
    twice = sorted({name for name in names if names.count(name) > 1})
    raise_problems(file, [f"{name!r} stands more than once" for name in twice], "Give each another name")
    for variation in design.variations:
        design.changed(variation.changes)
    for sweep in design.sweeps:
        for line, point in product(sweep.lines, sweep.points):
            design.changed(sweep.changes(line, point))
    return design
