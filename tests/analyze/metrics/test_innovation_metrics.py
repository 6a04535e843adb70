"""Expected numbers by hand."""

import numpy as np

from fusetune.analyze.metrics.innovation_metrics import mean_innovation, rms_innovation, rms_norm


def test_rms_of_one_component() -> None:
    # sqrt((9 + 16) / 2)
    assert rms_innovation(np.array([3.0, -4.0])) == np.sqrt(12.5)


def test_rms_works_on_several_sets_at_once() -> None:
    np.testing.assert_allclose(rms_innovation(np.array([[3.0, -4.0], [1.0, 1.0]])), [np.sqrt(12.5), 1.0])


def test_horizontal_aggregate_is_the_root_mean_of_the_squared_norm() -> None:
    # residuals (3, 4) and (0, 5): norms 5 and 5
    assert rms_norm(np.array([[3.0, 0.0], [4.0, 5.0]])) == 5.0


def test_vertical_aggregate_is_the_one_dimensional_form() -> None:
    values = np.array([0.3, -0.1, 0.7])
    assert rms_norm(values[None]) == rms_innovation(values)


def test_mean_keeps_the_sign() -> None:
    assert mean_innovation(np.array([1.0, -3.0])) == -1.0
