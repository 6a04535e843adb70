"""The likelihood that is summed from terms is that of the model with the noises put in."""

import dataclasses

import numpy as np
import pytest
from tests.analyze.smoothing.made_models import random_model
from tests.analyze.smoothing.test_error_model import UPDATES_PER_STEP, still

from fusetune.analyze.smoothing.error_model import ErrorModel, PositionErrors
from fusetune.analyze.smoothing.linear_smoother import smooth
from fusetune.analyze.smoothing.noise_terms import NoiseTerms
from fusetune.analyze.smoothing.velocity_models import (
    DOWN,
    PLANE,
    PositionSeries,
    Stretch,
    horizontal_model,
    vertical_model,
)


@pytest.mark.parametrize("factors", [(1.0, 1.0, 1.0), (0.3, 5.0, 2.0)])
def test_variances_times_factors(factors: tuple[float, float, float]) -> None:
    model = random_model(6)
    terms = NoiseTerms(model, [slice(0, 1), slice(1, 3)], [slice(0, 2)])
    q = model.process_variance * [factors[0], factors[1], factors[1]]
    there = dataclasses.replace(model, process_variance=q, measurement_variance=model.measurement_variance * factors[2])
    found, expected = terms.likelihood(factors), smooth(there).likelihood
    assert found.cost == pytest.approx(expected.cost, rel=1e-9)
    assert found.log_determinant == pytest.approx(expected.log_determinant, rel=1e-9)


@pytest.mark.parametrize("errors", [
    ErrorModel(0.1, 0.0, 0.0, 0.02, (PositionErrors(0.3, 0.1),)),
    ErrorModel(0.07, 0.2, 3.0, 0.01, (PositionErrors(0.2, 0.05),)),
])  # fmt: skip
def test_of_a_flight_horizontally_and_vertically(errors: ErrorModel) -> None:
    sums = still(30.0)
    epoch = np.arange(UPDATES_PER_STEP, sums.time.size, UPDATES_PER_STEP)
    generator = np.random.default_rng(1)
    plane = generator.normal(size=(epoch.size, 2))
    plane[5] = np.nan
    positions = (
        PositionSeries("gnss_pos", PLANE, plane, is_delayed=True),
        PositionSeries("baro_hgt", DOWN, generator.normal(size=(epoch.size, 1)), is_delayed=False),
    )
    stretch = Stretch(sums, epoch, 0.1 * generator.normal(size=(epoch.size, 3)), positions)
    across = horizontal_model(stretch)
    for model in (across, vertical_model(stretch, smooth(across(errors)))):
        found, expected = model.likelihood(errors), smooth(model(errors)).likelihood
        assert found.cost == pytest.approx(expected.cost, rel=1e-8)
        assert found.log_determinant == pytest.approx(expected.log_determinant, rel=1e-8)
    assert across.measurements == 4 * epoch.size - 2
