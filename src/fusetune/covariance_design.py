"""A covariance design from its file to its tables and figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fusetune.design.covariance.design_file import load_design
from fusetune.design.covariance.ekf2_design import Ekf2Design, LoggedWay
from fusetune.design.covariance.evaluation import Evaluation, evaluate
from fusetune.design.covariance.outputs import write_evaluation
from fusetune.design.covariance.track import Track
from fusetune.design.missions.mission import load_mission
from fusetune.execute.mission_track import mission_track
from fusetune.execute.vehicle import load_vehicle
from fusetune.report.figures.covariance_figures import draw_evaluation
from fusetune.save.logged_track import logged_track
from fusetune.storage.files import AnyPath


def make_covariance_design(file: AnyPath, folder: AnyPath) -> tuple[Evaluation, list[Path]]:
    """Evaluate a design and write its tables and figures.

    Returns
    -------
    What was found, and the files of the figures.

    Raises
    ------
    UserError
        The design, or a file that it names, cannot be used.
    """
    design = load_design(file)
    if isinstance(design, Ekf2Design):
        design = replace(design, track=track_of_design(design))
    evaluation = evaluate(design)
    write_evaluation(evaluation, folder)
    return evaluation, draw_evaluation(evaluation, folder)


def track_of_design(design: Ekf2Design) -> Track:
    """The way that a design names: of a mission that is flown, or of a flight."""
    if isinstance(design.way, LoggedWay):
        return logged_track(design.way.log)
    return mission_track(load_mission(design.way.mission), load_vehicle(design.way.vehicle), design.way.seed)
