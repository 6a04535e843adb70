"""Bounds of innovations are those by which the estimator tests: it rejects what lies beyond gate · σ, and only that."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from fusetune.report.flight_data.innovation_panels import (
    AxisInnovations,
    SetInnovations,
    innovation_panels,
    ratio_panels,
    split_by_axis,
)

GATE = 3.0


def innovations(gate: float = GATE, count: int = 50, seed: int = 1) -> AxisInnovations:
    """Tested as PX4 does (`updateAidSourceStatus`): test ratio = ν² / (gate² S), rejected above 1; single precision."""
    generator = np.random.default_rng(seed)
    variance = generator.uniform(0.5, 2.0, count).astype(np.float32)
    innovation = (generator.normal(0.0, 3.0, count) * np.sqrt(variance)).astype(np.float32)
    ratio = innovation**2 / (np.float32(gate) ** 2 * variance)
    time = 1_000_000 + np.arange(count, dtype=np.int64) * 200_000
    return AxisInnovations(time, innovation, variance, ratio, ratio > 1.0, ratio <= 1.0)


def of_set(samples: AxisInnovations, **parameters: float) -> SetInnovations:
    return SetInnovations("one", "one", {("baro_hgt", 0): samples}, parameters)


def test_what_is_beyond_the_bound_is_what_the_estimator_rejected() -> None:
    (panel,) = innovation_panels([of_set(innovations(), EKF2_BARO_GATE=GATE)])
    (series,) = panel.series
    assert (panel.id, panel.title, panel.unit) == ("innovation.baro_hgt.0", "Barometer height", "m")
    assert series.gate is not None
    assert series.sigma is not None
    assert series.rejected is not None
    beyond = np.abs(series.values) > series.gate * series.sigma
    assert 0 < beyond.sum() < beyond.size
    assert beyond.tolist() == series.rejected.tolist()
    ratio = (series.values / (series.gate * series.sigma)) ** 2
    np.testing.assert_allclose(ratio, innovations().ratio, rtol=1e-5)


@pytest.mark.parametrize("told", [{}, {"EKF2_BARO_GATE": 5.0}])
def test_a_gate_that_no_parameter_tells_follows_from_the_samples(told: dict[str, float]) -> None:
    """A constant of PX4, as of gravity, or a parameter that was changed in flight."""
    assert innovations().gate(told.get("EKF2_BARO_GATE", np.nan)) == GATE


def test_samples_without_a_ratio_have_the_gate_of_the_parameters() -> None:
    silent = innovations()
    silent.ratio[:] = np.nan
    assert silent.gate(5.0) == 5.0
    assert silent.gate(np.nan) is None


def test_some_innovations_that_were_changed_after_the_test_do_not_change_the_gate() -> None:
    """EKF2 shortens the barometer's near the ground by EKF2_GND_EFF_DZ when it has tested them."""
    samples = innovations()
    samples.innovation[:20] *= 0.5
    assert samples.gate(GATE) == GATE


def test_ratios_are_the_largest_of_the_axes() -> None:
    axes = [innovations(seed=seed) for seed in (1, 2)]
    one = SetInnovations("one", "one", {("gnss_pos", axis): samples for axis, samples in enumerate(axes)}, {})
    (panel,) = ratio_panels([one])
    (series,) = panel.series
    assert (panel.kind, panel.limit, panel.log) == ("ratio", 1.0, True)
    assert series.values.tolist() == np.maximum(axes[0].ratio, axes[1].ratio).tolist()


def test_nothing_is_shown_of_before_a_source_was_fused() -> None:
    """A filter that has no origin yet has innovations of thousands of kilometres."""
    table = pa.table(
        {
            "source": pa.array(["gnss_pos"] * 4 + ["fake_pos"] * 2).dictionary_encode(),
            "axis": pa.array([0, 0, 0, 0, 0, 0], pa.int32()),
            "timestamp_sample": pa.array([1, 2, 3, 4, 1, 2], pa.int64()),
            "innovation": pa.array([5e6, 5e6, 0.1, 9.0, 0.0, 0.0], pa.float32()),
            "innovation_variance": pa.array([1.0] * 6, pa.float32()),
            "test_ratio": pa.array([1e12, 1e12, 0.0, 3.2, 0.0, 0.0], pa.float32()),
            "innovation_rejected": [True, True, False, True, False, False],
            "fused": [False, False, True, False, True, True],
        }
    )
    found = split_by_axis(table)
    assert list(found) == [("gnss_pos", 0)], "what is invented to bound the filter measures nothing"
    assert found["gnss_pos", 0].time.tolist() == [3, 4]
