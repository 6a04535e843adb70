"""What design leaves on disk: a plan and parameter files for QGroundControl, and the table of sets."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fusetune.design.missions.mission import load_mission
from fusetune.design.missions.plan_writing import write_mission_plan
from fusetune.design.parameter_sets import ParameterSet
from fusetune.design.study import Study, load_study
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS
from fusetune.px4.parameters.params_file import ParamEntry, ParamsHeader, write_params
from fusetune.px4.releases import AUTO
from fusetune.storage.files import atomic_path

AROUND_FOLDER = "around_present"


def write_design(
    mission_file: str | os.PathLike[str],
    study_file: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    around: Sequence[ParameterSet] = (),
    release: str = AUTO,
) -> None:
    """Write all that a mission and a study lead to: ``<mission>.plan``, ``<set>.params`` and ``sets.parquet``.

    Of a study around the present values the parameter files lie in a folder ``around_present``, which then holds just
    those.

    Parameters
    ----------
    around : the sets of such a study, which flights have led to
    release : of PX4, whose parameters the study may name, as in the configuration

    Raises
    ------
    UserError
        The mission or the study is broken.
    """
    mission, study = load_mission(mission_file), load_study(study_file, release)
    target = Path(folder)
    write_mission_plan(mission, target / f"{mission.name}.plan")
    write_study(replace(study, sets=(*study.sets, *around)), target, target / AROUND_FOLDER if study.around else target)


def write_study(study: Study, folder: str | os.PathLike[str], params_folder: str | os.PathLike[str]) -> None:
    """Write the sets: ``sets.parquet`` and, elsewhere or not, ``<set>.params``."""
    for parameter_set in study.sets:
        write_set_params(study, parameter_set, Path(params_folder) / f"{parameter_set.name}.params")
    write_sets_table(study, Path(folder) / "sets.parquet")


def write_set_params(study: Study, parameter_set: ParameterSet, path: str | os.PathLike[str]) -> None:
    """Write a set as a QGroundControl parameter file, with what each parameter is as a comment above it."""
    entries = [_entry(name, value) for name, value in sorted(parameter_set.overrides.items())]
    about = f": {parameter_set.description}" if parameter_set.description else ""
    header = ParamsHeader(comments=(f"Study {study.name}, set {parameter_set.name}{about}",))
    write_params(path, entries, header)


def _entry(name: str, value: float) -> ParamEntry:
    metadata = ALL_PARAMETERS[name]
    unit = f" {metadata.unit}" if metadata.unit else ""
    reboot = "; takes effect after a reboot" if metadata.reboot_required else ""
    return ParamEntry(name, value, metadata.type, (f"{name}: default {metadata.default:.9g}{unit}{reboot}",))


def write_sets_table(study: Study, path: str | os.PathLike[str]) -> None:
    """Write the sets as a Parquet table, one row per set and parameter, in the order of the study."""
    # Imported here: everything else of this room is also read when the workflow starts, and that must stay quick.
    import pyarrow as pa

    from fusetune.storage.parquet import write_table

    rows = [(one.name, name, float(value)) for one in study.sets for name, value in sorted(one.overrides.items())]
    schema = pa.schema([("set", pa.string()), ("parameter", pa.string()), ("value", pa.float64())])
    table = pa.Table.from_pylist([dict(zip(schema.names, row, strict=True)) for row in rows], schema)
    with atomic_path(path) as temporary:
        write_table(table, temporary)
