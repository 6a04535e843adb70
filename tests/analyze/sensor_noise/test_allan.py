from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.analyze.sensor_noise.allan import AllanCurve, allan_curve, degrees_of_freedom, pooled_curve


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


def test_deviations_are_those_of_allantools() -> None:
    allantools = pytest.importorskip("allantools", reason="allantools is not installed here")
    values = np.cumsum(np.random.default_rng(2).standard_normal(3000)) * 0.1
    curve = allan_curve([values], 0.02)
    tau, deviation, _, _ = allantools.oadev(values, rate=50.0, data_type="freq", taus=curve.tau_s)
    assert tau == pytest.approx(curve.tau_s)
    assert curve.deviation == pytest.approx(deviation, rel=1e-9)


@pytest.mark.parametrize(("kind", "alpha"), [("white", 0), ("flicker", -1), ("walk", -2)])
def test_degrees_of_freedom_are_those_of_allantools(kind: str, alpha: int) -> None:
    ci = pytest.importorskip("allantools.ci", reason="allantools is not installed here")
    factors = np.array([2, 4, 16, 64, 250])
    expected = [ci.edf_simple(1001, m, alpha) for m in factors]
    assert degrees_of_freedom(kind, 1000, factors) == pytest.approx(np.maximum(expected, 1.0), rel=1e-9)


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
