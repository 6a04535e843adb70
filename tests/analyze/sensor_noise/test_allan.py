from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.analyze.sensor_noise.allan import AllanCurve, NoiseKind, allan_curve, degrees_of_freedom, pooled_curve


def test_variance_is_that_of_a_hand_calculation() -> None:
    # means over one: differences 2, 1, -4, 3 → (4 + 1 + 16 + 9) / 8; over two there would be two means only
    curve = allan_curve([np.array([1.0, 3.0, 4.0, 0.0, 3.0])], 0.5)
    assert curve.factors.tolist() == [1]
    assert curve.tau_s.tolist() == [0.5]
    assert curve.variance == pytest.approx([30.0 / 8.0])


def test_every_start_counts() -> None:
    values = np.random.default_rng(1).standard_normal(50)
    curve = allan_curve([values], 1.0)
    for m, variance in zip(curve.factors, curve.variance, strict=True):
        means = np.array([values[i : i + m].mean() for i in range(len(values) - m + 1)])
        assert variance == pytest.approx(0.5 * np.mean((means[m:] - means[:-m]) ** 2))


OADEV = {
    1: 0.0708654445121, 2: 0.0859888462614, 4: 0.114651707005, 8: 0.156016759903, 16: 0.220984664725,
    32: 0.301688550182, 64: 0.441563117669, 128: 0.687303910575, 256: 1.07822568906, 512: 1.81546279395,
}  # fmt: skip
"""Of `WALK`, by allantools 2024.6, `oadev(WALK, rate=50.0, data_type="freq")`: a dependency of the tests it is not, for
it brings Sphinx along."""
WALK = np.cumsum(np.random.default_rng(2).standard_normal(3000)) * 0.1
FREEDOM = {
    "white": [569.907806479, 345.974720931, 91.3081554014, 21.434954575, 4.00391592568],
    "flicker": [621.897343595, 309.106922507, 74.6247169924, 16.4043017865, 2.86122501428],
    "walk": [498.503010028, 247.75902908, 59.7431697061, 12.9197463062, 2.0060160401],
}
"""By the same, `ci.edf_simple(1001, m, alpha)` with alpha 0, −1 and −2 at m of 2, 4, 16, 64 and 250."""


def test_deviations_are_those_of_allantools() -> None:
    curve = allan_curve([WALK], 0.02)
    assert dict(zip(curve.factors.tolist(), curve.deviation.tolist(), strict=True)) == pytest.approx(OADEV, rel=1e-9)


@pytest.mark.parametrize("kind", FREEDOM)
def test_degrees_of_freedom_are_those_of_allantools(kind: NoiseKind) -> None:
    found = degrees_of_freedom(kind, 1000, np.array([2, 4, 16, 64, 250]))
    assert found == pytest.approx(FREEDOM[kind], rel=1e-9)


@given(st.floats(-1e3, 1e3), st.integers(8, 200), st.integers(0, 2**32 - 1))
def test_a_constant_changes_nothing(constant: float, samples: int, seed: int) -> None:
    values = np.random.default_rng(seed).standard_normal(samples)
    assert allan_curve([values + constant], 0.1).variance == pytest.approx(
        allan_curve([values], 0.1).variance, rel=1e-6
    )


def test_pooled_curves_are_the_curve_of_all_stretches() -> None:
    rng = np.random.default_rng(3)
    stretches = [rng.standard_normal((length, 3)) * size for length, size in ((400, 1.0), (90, 2.0), (1000, 0.5))]
    together = allan_curve(stretches, 0.01)
    pooled = pooled_curve(allan_curve([one], step) for one, step in zip(stretches, (0.01, 0.0101, 0.01), strict=True))
    assert pooled is not None
    assert pooled.variance == pytest.approx(together.variance)
    assert pooled.lengths == together.lengths
    assert pooled.freedom["white"] == pytest.approx(together.freedom["white"])


def test_curves_of_another_rate_are_left_out() -> None:
    rng = np.random.default_rng(4)
    fast, slow = allan_curve([rng.standard_normal(1000)], 0.004), allan_curve([rng.standard_normal(100)], 0.005)
    pooled = pooled_curve([slow, fast])
    assert pooled is not None
    assert pooled.lengths == fast.lengths
    assert pooled_curve([]) is None


def test_document_gives_the_curve_back() -> None:
    curve = allan_curve([np.random.default_rng(5).standard_normal((300, 2))], 0.02)
    again = AllanCurve.from_document(curve.document())
    assert again.variance == pytest.approx(curve.variance)
    assert again.lengths == curve.lengths
    assert again.step_s == curve.step_s
