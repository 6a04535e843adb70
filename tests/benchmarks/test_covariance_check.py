"""That the errors which the check compares are those of the flights: one of them, against its own estimator's P."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from benchmarks.covariance_check import (
    GROUPS,
    WORLDS,
    Compared,
    compared,
    consistent_vehicle,
    designed_along,
    errors_of,
)

from fusetune.design.missions.mission import load_mission
from fusetune.execute.simulation import fly


def test_one_flight_of_the_check_errs_as_its_estimator_says(project_root: Path) -> None:
    mission, vehicle = load_mission(project_root / "config/missions/short_survey.yaml"), consistent_vehicle()
    flight = errors_of(fly(mission, vehicle, WORLDS["consistent"], 7, with_estimator=False))
    table: Compared = compared([flight], designed_along(vehicle, mission, with_barometer=False))
    assert table.errors.shape == table.own.shape == (1, *table.designed.shape[:2])
    designed, own = np.einsum("kii->ki", table.designed).mean(axis=0), table.own.mean(axis=(0, 1))
    assert np.sqrt(own / designed).round(1).tolist() == [1.0] * 9
    for first, last in GROUPS.values():
        # some tens of seconds of one flight: errors that hang together, so only their size is told
        ratio = np.square(table.errors[..., first:last]).sum(axis=-1).mean() / own[first:last].sum()
        assert 0.2 < ratio < 4.0
    assert len(list(table.lines())) == 2 + len(GROUPS)
