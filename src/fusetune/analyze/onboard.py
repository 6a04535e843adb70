"""As flown: the innovations that the vehicle's own estimator logged, brought to the layout of a replay."""

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.set_files import AxisSamples, SourceAxis
from fusetune.analyze.sources import AID_SOURCES
from fusetune.files import AnyPath, atomic_path
from fusetune.parquet import write_table
from fusetune.px4.estimator_instances import rows_of_primary
from fusetune.px4.flight import Flight, TopicTable

ONBOARD = "onboard"
"""Name under which the vehicle's own figures stand beside the sets; it is never ranked."""

_FIELDS = ("observation_variance", "innovation", "innovation_variance", "test_ratio")


def onboard_samples(flight: Flight, instance: int | None = None) -> dict[SourceAxis, AxisSamples]:
    """Innovations that the vehicle logged, from the canonical topics `estimator_aid_src_*`.

    Parameters
    ----------
    flight : in the layout of `px4.release_layouts.canonical`
    instance : of the estimator; None takes, of each time, the one that was primary then

    Returns
    -------
    Samples by source and axis; empty where the log holds none.
    """
    samples: dict[SourceAxis, AxisSamples] = {}
    for name, source in AID_SOURCES.items():
        topic = f"estimator_aid_src_{name}"
        table = rows_of_primary(flight, topic) if instance is None else flight.topic(topic, instance)
        if table is None or table["timestamp"].size == 0:
            continue
        for axis in range(source.axes):
            column = f"[{axis}]" if f"innovation[{axis}]" in table else ""
            if f"innovation{column}" in table and f"innovation_variance{column}" in table:
                samples[name, axis] = _axis_samples(table, column)
    return samples


def _axis_samples(table: TopicTable, column: str) -> AxisSamples:
    time = table["timestamp_sample"] if np.all(table.get("timestamp_sample", np.zeros(1)) > 0) else table["timestamp"]
    rows = np.sort(np.unique(time, return_index=True)[1])
    length = rows.size

    def values(field: str) -> npt.NDArray[np.float64]:
        found = table.get(f"{field}{column}")
        return np.full(length, np.nan) if found is None else found[rows].astype(np.float64)

    flags = {
        name: table[name][rows].astype(bool) if name in table else np.full(length, default)
        for name, default in (("innovation_rejected", False), ("fused", True))
    }
    return AxisSamples(
        timestamp_sample=time[rows].astype(np.int64),
        observation_variance=values("observation_variance"),
        innovation=values("innovation"),
        innovation_variance=values("innovation_variance"),
        test_ratio=values("test_ratio"),
        rejected=flags["innovation_rejected"],
        fused=flags["fused"],
    )


def write_onboard(path: AnyPath, samples: dict[SourceAxis, AxisSamples]) -> None:
    """Write the vehicle's own innovations in the layout of `<set>.innovations.parquet`."""
    columns: dict[str, list[npt.NDArray]] = {name: [] for name in ("timestamp_sample", *_FIELDS, "rejected", "fused")}
    keys = sorted(samples)
    counts = [samples[key].timestamp_sample.size for key in keys]
    names = list(dict.fromkeys(source for source, _ in keys))
    for key in keys:
        for name, parts in columns.items():
            parts.append(getattr(samples[key], name))
    index = np.repeat(np.array([names.index(source) for source, _ in keys], dtype=np.int32), counts)
    source = pa.DictionaryArray.from_arrays(pa.array(index), pa.array(names, pa.string()))
    axes = np.repeat(np.array([axis for _, axis in keys], dtype=np.int32), counts)

    def joined(name: str, dtype: type) -> pa.Array:
        return pa.array(np.concatenate([np.zeros(0, dtype=dtype), *columns[name]]).astype(dtype))

    table = pa.table(
        {
            "source": source,
            "axis": pa.array(axes),
            "timestamp_sample": joined("timestamp_sample", np.int64),
            **{name: joined(name, np.float64) for name in _FIELDS},
            "innovation_rejected": joined("rejected", np.bool_),
            "fused": joined("fused", np.bool_),
        }
    )
    with atomic_path(path) as temporary:
        write_table(table, temporary)
