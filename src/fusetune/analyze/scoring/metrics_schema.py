"""Columns of the long table of figures, `metrics.parquet`."""

import pyarrow as pa

METRICS_SCHEMA = pa.schema(
    [
        pa.field("flight", pa.string()),
        pa.field("set", pa.string()),
        pa.field("source", pa.string()),
        pa.field("axis", pa.string()),
        pa.field("metric", pa.string()),
        pa.field("value", pa.float64()),
        pa.field("lower", pa.float64()),
        pa.field("upper", pa.float64()),
        pa.field("n", pa.float64()),
    ]
)
"""`n` is the number of samples behind the figure (N_eff where the figure says so), `lower`, `upper` its bounds."""
