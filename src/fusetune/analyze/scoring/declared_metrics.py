"""Every metric that `metrics.parquet` holds, by families; docs/metrics.md is made from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from fusetune.analyze.metrics.declared import INNOVATION_METRICS
from fusetune.analyze.metrics.error_figures import COMPONENT_METRICS, NEES, NEES_EFFECTIVE, NORM_METRICS
from fusetune.analyze.metrics.metric import InnovationMetric, Metric
from fusetune.analyze.scoring.filter_events import EVENT_METRICS, ON_GROUND, SERVICE_METRICS
from fusetune.analyze.scoring.ground_metrics import GROUND
from fusetune.analyze.scoring.withheld_scores import DRIFT, WITHHELD_METRICS
from fusetune.analyze.sensors.source_whiteness import WHITENESS_METRICS
from fusetune.analyze.sensors.told_noise import TOLD_METRICS


class Family(NamedTuple):
    """Metrics that are made of the same."""

    title: str
    metrics: Sequence[Metric[Any]]


FAMILIES = (
    Family("Innovations of a source, by axis; with ● also by group of axes", INNOVATION_METRICS),
    Family("How a source served in flight after the warm-up", SERVICE_METRICS),
    Family("The error of the source itself, see below, of the present set and of `delay_mended`", WHITENESS_METRICS),
    Family("What the estimator is told of a source, by axis, of the present set", TOLD_METRICS),
    Family("Predictions while a sensor is withheld", (*WITHHELD_METRICS, DRIFT)),
    Family("What the filter did beside fusing: source `filter`", EVENT_METRICS),
    Family(
        "Errors against a reference: source `<reference>_<quantity>`",
        (*dict.fromkeys((*NORM_METRICS, *COMPONENT_METRICS)), NEES, NEES_EFFECTIVE),
    ),
)


def metric_names() -> Iterator[str]:
    """Names of all metrics; what stands in braces is filled in."""
    for family in FAMILIES:
        for metric in family.metrics:
            yield metric.name
            if isinstance(metric, InnovationMetric):
                yield from _other_names(metric)
            elif metric in ON_GROUND:
                yield GROUND + metric.name


def _other_names(metric: InnovationMetric) -> Iterator[str]:
    if metric.window is not None:
        yield metric.window.worst
    if metric.on_ground:
        yield GROUND + metric.name


def metrics_page() -> str:
    """The tables of docs/metrics.md, in Markdown."""
    return "\n\n".join(map(_table, FAMILIES))


def _table(family: Family) -> str:
    head = [f"**{family.title}**", "", "| metric | unit | what it is | better | read by |", "|---|---|---|---|---|"]
    return "\n".join([*head, *(row for metric in family.metrics for row in _rows(metric))])


def _rows(metric: Metric[Any]) -> Iterator[str]:
    mark = " ●" if isinstance(metric, InnovationMetric) and metric.of_groups else ""

    def row(name: str, words: str, used: Sequence[str] = ()) -> str:
        return f"| `{name}`{mark} | {metric.unit} | {words} | {metric.better} | {', '.join(used)} |"

    yield row(metric.name, metric.words, metric.used)
    if isinstance(metric, InnovationMetric) and metric.window is not None:
        yield row(metric.window.worst, "largest of any window of 30 s; all windows are in `windows.parquet`")
    if isinstance(metric, InnovationMetric) and metric.on_ground:
        yield row(GROUND + metric.name, "the same on the ground, two seconds before take-off excluded")
    if metric in ON_GROUND:
        yield row(GROUND + metric.name, "the same on the ground, all kinds together")
