"""What the files of a search say, made by hand: four flights in two parts, one parameter that changes, one put back."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusetune.apply.evidence import AIMS
from fusetune.apply.sensitivity.files import NOTHING_TOLD
from fusetune.apply.trials import Trials
from fusetune.design.factors import Factor
from fusetune.report.search_results import SearchResults

NOW = {"EKF2_GPS_V_NOISE": 0.3, "EKF2_BARO_NOISE": 3.5, "EKF2_GPS_DELAY": 110.0}
FOUND = {"EKF2_GPS_V_NOISE": 0.15, "EKF2_BARO_NOISE": 3.5, "EKF2_GPS_DELAY": 110.0}


def parameter(name: str, **other: Any) -> dict[str, Any]:
    linear = name.endswith("DELAY")
    low, high = (10.0, 210.0) if linear else (NOW[name] / 8.0, NOW[name] * 8.0)
    return {
        "present": NOW[name],
        "found": FOUND[name],
        "before_putting_back": FOUND[name],
        "is_changed": FOUND[name] != NOW[name],
        "alone_percent": 3.4 if FOUND[name] != NOW[name] else None,
        "at_bound": "",
        "scale": "linear" if linear else "log",
        "low": low,
        "high": high,
    } | other


def part(name: str, aside: tuple[str, ...], seen: float, kept: float | None, v_noise: float) -> dict[str, Any]:
    return {
        "search": name,
        "flights": [],
        "kept_aside": list(aside),
        "values": FOUND | {"EKF2_GPS_V_NOISE": v_noise},
        "changed": ["EKF2_GPS_V_NOISE"],
        "gain_in_search_percent": seen,
        "gain_kept_aside_percent": kept,
    }


def made_search(status: str = "change", **other: Any) -> SearchResults:
    search: dict[str, Any] = {
        "product": "fusetune 0",
        "status": status,
        "exploratory": False,
        "parameters_found": {"EKF2_GPS_V_NOISE": 0.15},
        "expected_gain": {"percent": 4.0, "lower_percent": -1.0, "upper_percent": 9.0},
        "gain_in_search_percent": 9.0,
        "gain_kept_aside_percent": 4.0,
        "kept_aside": {"a": 6.0, "b": -2.0, "c": 5.0, "d": 7.0},
        "objections": [],
        "parameters": {
            "EKF2_BARO_NOISE": parameter("EKF2_BARO_NOISE", before_putting_back=2.8),
            "EKF2_GPS_V_NOISE": parameter("EKF2_GPS_V_NOISE"),
            "EKF2_GPS_DELAY": parameter("EKF2_GPS_DELAY"),
        },
        "searches": [
            part("all flights", (), 9.0, None, 0.15),
            part("without part 1", ("a", "b"), 10.0, 2.0, 0.15),
            part("without part 2", ("c", "d"), 6.0, 6.0, 0.12),
        ],
        "flights": ["a", "b", "c", "d"],
        "flights_left_out": {"e": "its replay has trust grade D"},
        "settings": {"putting_back_percent": 1.0},
        "candidates": [{"search": "all flights"}] * 30 + [{"search": "without part 1"}] * 30,
    }
    change = {"name": "EKF2_GPS_V_NOISE", "previous": 0.3, "value": 0.15, "unit": "m/s"}
    decision: dict[str, Any] = {
        "status": status,
        "cautions": ["Mind its <attitude>."],
        "changes": [change] if status == "change" else [],
        "on_vehicle": {"parameters": [change] if status == "change" else [], "refused": []},
        "chosen": "found" if status == "change" else "present",
        "ranking": [
            {"name": "found", "is_present": False, "reasons": []},
            {"name": "present", "is_present": True, "reasons": []},
        ],
        "next_steps": [{"kind": "load", "text": "Load it.", "command": ""}],
        "paragraphs": ["Fly it.", "Mind its <attitude>.", "Next: Load it."],
        "vehicle": {"in_words": "quadrotor X"},
    }
    differences = np.log([[0.95] * 4, [1.1] * 4])
    trials = Trials(
        (Factor("EKF2_GPS_V_NOISE", "log", 0.0375, 2.4, 0.3, 2.0),),
        ("found", "all 4.1"),
        np.array([[0.15], [0.9]]),
        ("a", "b", "c", "d"),
        differences,
        dict.fromkeys(AIMS, differences),
        np.ones((2, 4), dtype=bool),
    )
    return SearchResults(search | other, decision, trials, NOTHING_TOLD)
