"""Columns of the long table of figures, `metrics.parquet`."""

import pyarrow as pa

from fusetune.analyze.scoring.columns import BY_AXIS, columns_of

METRICS_SCHEMA = pa.schema(
    [*BY_AXIS, pa.field("metric", pa.string()), *columns_of(pa.float64(), "value", "lower", "upper", "n")]
)
"""`n` is the number of samples behind the figure (N_eff where the figure says so), `lower`, `upper` its bounds."""
