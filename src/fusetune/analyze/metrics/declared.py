"""The metrics of innovations in the order of the table; all families are gathered in `scoring.declared_metrics`."""

from fusetune.analyze.metrics import break_rate, consistency, innovation_metrics, likelihood, whiteness
from fusetune.analyze.metrics.metric import InnovationMetric

INNOVATION_METRICS: tuple[InnovationMetric, ...] = (
    *innovation_metrics.METRICS,
    *consistency.METRICS,
    *whiteness.METRICS,
    *likelihood.METRICS,
    *break_rate.METRICS,
)
