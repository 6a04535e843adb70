"""Which sources the outcome of a job follows from: when they change, the job runs again.

What earlier jobs were made by need not be repeated: their files are made again, and by that all that was made of these.
A test compares these lists with what the scripts of the jobs import.
"""

from __future__ import annotations

from fusetune.storage.digest import source_digests

BASE = (
    "check.py",
    "errors.py",
    "finding.py",
    "px4",
    "quaternions.py",
    "set_names.py",
    "settings",
    "storage",
    "time_limit.py",
)

_SCORED = (
    "analyze/analyze_flight.py",
    "analyze/flight",
    "analyze/flight_files.py",
    "analyze/metrics",
    "analyze/reconstruction",
    "analyze/replaying",
    "analyze/scored_sets.py",
    "analyze/scoring",
    "analyze/scored_sets.py",
    "analyze/sensors",
    "analyze/smoothing",
    "analyze/trust",
)

TRIED = (*BASE, "design", "ekf2", "save", *_SCORED, "analyze/delays", "analyze/trials")
"""What the figures of a set that is tried in a search follow from."""

JOB_SOURCES = {
    "design": (*BASE, "design"),
    "mission": (
        *BASE,
        "design",
        "ekf2",
        "execute",
        "report/__init__.py",
        "report/figures/__init__.py",
        "report/figures/drawing.py",
        "report/figures/figures.mplstyle",
        "report/figures/mission_figure.py",
    ),
    "covariance": (
        *BASE,
        "covariance_design.py",
        "design",
        "ekf2",
        "execute",
        "report/__init__.py",
        "report/figures/__init__.py",
        "report/figures/covariance_figures.py",
        "report/figures/drawing.py",
        "save",
    ),
    "execute": (*BASE, "ekf2", "design", "execute"),
    "save": (*BASE, "design", "ekf2/compiled", "ekf2/feed", "ekf2/releases", "save"),
    "replay": (
        *BASE,
        "design",
        "ekf2",
        "save",
        "analyze/flight",
        "analyze/metrics",
        "analyze/reconstruction",
        "analyze/replaying",
    ),
    "delays": (
        *BASE,
        "ekf2",
        "save",
        "analyze/delays",
        "analyze/flight_files.py",
        "analyze/sensors",
        "analyze/smoothing",
    ),
    "diagnose": (*BASE, "design", "ekf2", "save", "analyze"),
    "conformance": (
        *BASE,
        "design",
        "save",
        "analyze/conformance",
        "analyze/flight",
        "analyze/flight_files.py",
        "analyze/metrics",
        "analyze/scoring/aims.py",
    ),
    "score": (*BASE, "ekf2", "save", *_SCORED),
    "change": (*BASE, "ekf2", "save", *_SCORED, "analyze/evaluate.py", "apply/history"),
    "apply": (*BASE, "analyze/delays", "analyze/effects", "analyze/trials", "design", "apply"),
    "search": (*TRIED, "analyze/effects", "apply"),
    "report": (*BASE, "analyze/diagnosis", "design", "apply", "report"),
}
"""Kind of job → files and folders of the package."""


def job_digests() -> dict[str, str]:
    """One figure for the state of the sources of each kind of job."""
    return source_digests(JOB_SOURCES)
