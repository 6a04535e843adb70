"""What metrics declare of themselves against what is written, read and documented."""

from __future__ import annotations

import re
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.analyze.made_flight import MadeSet, make_flight
from tests.made_text import UpToDate

import fusetune
from fusetune.analyze.metrics.declared import INNOVATION_METRICS
from fusetune.analyze.metrics.metric import SOURCE_UNIT, Bounds, InnovationMetric, Innovations, Metric
from fusetune.analyze.scoring.declared_metrics import FAMILIES, metric_names, metrics_page
from fusetune.analyze.scoring.score_flight import score_saved_flight

EVERY: list[Metric] = [metric for family in FAMILIES for metric in family.metrics]
PACKAGE = Path(fusetune.__file__).parent


def pattern(name: str) -> str:
    """Regular expression for a name; what stands in braces is filled in."""
    return re.sub(r"\\\{\w+\\\}", "[0-9.e+-]+", re.escape(name))


def test_the_page_lists_what_is_declared(project_root: Path, up_to_date: UpToDate) -> None:
    up_to_date(project_root / "docs/metrics.md", "metrics", metrics_page())


def test_every_figure_that_is_written_is_declared_and_those_of_innovations_are_all_written(tmp_path: Path) -> None:
    save, folder = make_flight(tmp_path, "flight", {"present": MadeSet(), "b": MadeSet(error=0.2)}, truth=True)
    score_saved_flight(save, folder, ["present", "b"])
    written = set(pd.read_parquet(folder / "metrics.parquet")["metric"])
    declared = [re.compile(pattern(name)) for name in metric_names()]
    assert {name for name in written if not any(one.fullmatch(name) for one in declared)} == set()
    assert {metric.name for metric in INNOVATION_METRICS} <= written
    assert {metric.window.worst for metric in INNOVATION_METRICS if metric.window} <= written
    assert {name for name in written if name.startswith("withheld_rms_")}
    assert {"rmse", "nees", "resets", "fused_share"} <= written


def test_names_are_given_once() -> None:
    assert [name for name, times in Counter(metric_names()).items() if times > 1] == []


@pytest.mark.parametrize("metric", EVERY, ids=[metric.name for metric in EVERY])
def test_who_reads_a_metric_is_declared(metric: Metric) -> None:
    # its name as a text in the sources of a package, or the beginning of a text that goes on with a figure
    start = metric.name.partition("{")[0]
    text = re.compile(rf'"{re.escape(start)}' + ("" if "{" in metric.name else '"'))
    readers = tuple(
        room
        for room in ("apply", "report")
        if any(
            text.search(file.read_text(encoding="utf-8"))
            for file in sorted((PACKAGE / room).rglob("*.py"))
            if file.name != "glossary.py"  # it explains words
        )
    )
    labelled = {"report"} if isinstance(metric, InnovationMetric) and metric.label else set()
    assert set(metric.used) == {*readers, *labelled}


@pytest.mark.parametrize("metric", EVERY, ids=[metric.name for metric in EVERY])
def test_a_declaration_fits_into_a_table(metric: Metric) -> None:
    assert metric.unit in ("1", "s", "nat", SOURCE_UNIT)
    assert metric.words
    assert not re.search(r"(?<!\\)\|", metric.words)


@pytest.mark.parametrize("metric", INNOVATION_METRICS, ids=[metric.name for metric in INNOVATION_METRICS])
@pytest.mark.parametrize("axes", [1, 3])
def test_a_metric_gives_one_figure_for_each_set(metric: InnovationMetric, axes: int) -> None:
    made = innovations(axes, sets=2, seed=axes)
    value = metric.function(made)
    if isinstance(value, Bounds):
        assert value.value.shape == value.lower.shape == value.upper.shape == (2,)
        value = value.value
    assert value.shape == (2,)
    assert np.isfinite(value).all()
    if metric.samples is not None:
        assert ((metric.samples(made) >= 1.0) & (metric.samples(made) <= made.samples)).all()
    if metric.window is not None:
        # the whole as one window has the metric's own value
        whole = metric.window.of_mean(np.mean(metric.window.score(made), axis=-1))
        np.testing.assert_allclose(whole, value, rtol=1e-12)


@pytest.mark.parametrize("metric", INNOVATION_METRICS, ids=[metric.name for metric in INNOVATION_METRICS])
def test_what_is_better_is_what_a_wrong_filter_does_worse(metric: InnovationMetric) -> None:
    # twice the error and a walk in it, at the variance of the right filter: no metric may be better for that
    right = innovations(1, sets=1, seed=5)
    wander = np.cumsum(np.random.default_rng(6).standard_normal(right.samples)) * 0.2
    wrong = Innovations(
        2.0 * right.innovation + wander + 1.0, right.innovation_variance, np.full_like(right.test_ratio, 2.0),
        right.rejected, right.winsor_limits,
    )  # fmt: skip
    values = [metric.function(one) for one in (right, wrong)]
    good, bad = (float(one.value[0] if isinstance(one, Bounds) else one[0]) for one in values)
    if metric.better == "lower":
        assert good < bad
    elif metric.better == "higher":
        assert good > bad
    else:
        aim = {"nearer to 0": 0.0, "nearer to the number of axes": 1.0}[metric.better]
        assert abs(good - aim) < abs(bad - aim)


def test_what_groups_share_of_an_axis_is_what_they_make_of_it_alone() -> None:
    """To the bit: two axes of three, the middle one left out as well, of two sets."""
    made = innovations(3, sets=2, seed=7)
    arrays = (made.innovation, made.innovation_variance, made.test_ratio, made.rejected)
    # of one set after the other
    each = [np.ascontiguousarray(values.swapaxes(0, 1)).reshape(1, 6, -1) for values in arrays]
    whole = Innovations(*each, lambda: [np.full((6, 1), 1.5)])
    for places in ([0, 1], [0, 2], [0, 1, 2], [2]):
        limits = [1.5] * len(places)
        shared = Innovations.of_places(whole, 2, places, limits)
        innovation, variance, ratio, rejected = (np.ascontiguousarray(values[places]) for values in arrays)
        own = Innovations(innovation, variance, ratio, rejected, partial(list, limits), of_group=True)
        for metric in INNOVATION_METRICS:
            if metric.of_groups:
                found, expected = metric.function(shared), metric.function(own)
                parts = ("value", "lower", "upper") if isinstance(expected, Bounds) else ()
                pairs = [(getattr(found, part), getattr(expected, part)) for part in parts] or [(found, expected)]
                for one, other in pairs:
                    np.testing.assert_array_equal(one, other, err_msg=metric.name)


def innovations(axes: int, sets: int, seed: int) -> Innovations:
    """White innovations of the variance that is claimed."""
    generator = np.random.default_rng(seed)
    variance = generator.uniform(0.5, 2.0, (axes, sets, 600))
    innovation = generator.standard_normal(variance.shape) * np.sqrt(variance)
    ratio = np.square(innovation) / (9.0 * variance)
    return Innovations(innovation, variance, ratio, ratio > 1.0, lambda: [5.0] * axes, of_group=axes > 1)
