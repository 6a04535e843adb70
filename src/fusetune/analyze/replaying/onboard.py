"""As flown: the innovations that the vehicle's own estimator logged, brought to the layout of a replay."""

from collections.abc import Collection, Iterator, Mapping

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.replaying.store.row_groups import tables_in_groups
from fusetune.px4.aid_sources import AID_SOURCE_TOPIC, MEASURED_SOURCES
from fusetune.px4.flight import Flight, TopicTable
from fusetune.px4.layouts.estimator_instances import rows_of_primary
from fusetune.storage.files import AnyPath

INNOVATION_TOPICS = (
    "estimator_innovations",
    "estimator_innovation_variances",
    "estimator_innovation_test_ratios",
    "ekf2_innovations",
    *(source.topic for source in MEASURED_SOURCES.values()),
)
"""Topics of any release that the innovations are read from, and those that `canonical` makes of them."""

_FIELDS = ("observation_variance", "innovation", "innovation_variance", "test_ratio")
_TIMES = ("timestamp", "timestamp_sample")
_READ = (*_TIMES, *_FIELDS, "innovation_rejected", "fused")

ONBOARD_SCHEMA = pa.schema(
    [
        pa.field("source", pa.dictionary(pa.int32(), pa.string())),
        pa.field("axis", pa.int32()),
        pa.field("timestamp_sample", pa.int64()),
        *(pa.field(name, pa.float64()) for name in _FIELDS),
        pa.field("innovation_rejected", pa.bool_()),
        pa.field("fused", pa.bool_()),
    ]
)


class OnboardSamples(Mapping[SourceAxis, AxisSamples]):
    """Innovations that the vehicle logged, by source and axis; made from the log's columns at each look-up."""

    def __init__(self, flight: Flight, instance: int | None) -> None:
        self._tables: dict[str, TopicTable] = {}
        self._columns: dict[SourceAxis, str] = {}
        for name, source in MEASURED_SOURCES.items():
            table = rows_of_primary(flight, source.topic) if instance is None else flight.topic(source.topic, instance)
            if table is None or table["timestamp"].size == 0:
                continue
            self._tables[name] = table
            for axis in range(source.axes):
                column = f"[{axis}]" if f"innovation[{axis}]" in table else ""
                if f"innovation{column}" in table and f"innovation_variance{column}" in table:
                    self._columns[name, axis] = column

    def __getitem__(self, key: SourceAxis) -> AxisSamples:
        return _axis_samples(self._tables[key[0]], self._columns[key])

    def __iter__(self) -> Iterator[SourceAxis]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __contains__(self, key: object) -> bool:
        return key in self._columns


def onboard_samples(flight: Flight, instance: int | None = None) -> OnboardSamples:
    """Innovations that the vehicle logged, from the canonical topics `estimator_aid_src_*`.

    Parameters
    ----------
    flight : in the layout of `px4.release_layouts.canonical`
    instance : of the estimator; None takes, of each time, the one that was primary then

    Returns
    -------
    Samples by source and axis; empty where the log holds none.
    """
    return OnboardSamples(flight, instance)


def with_onboard_columns(flight: Flight, sources: Collection[str]) -> Flight:
    """The flight with what `onboard_samples` reads of some sources, and the times alone of the others' samples."""
    named = {MEASURED_SOURCES[name].topic for name in sources}
    topics = {}
    for (name, instance), table in flight.topics.items():
        if name.startswith(AID_SOURCE_TOPIC):
            read = _READ if name in named else _TIMES
            table = {column: values for column, values in table.items() if column.partition("[")[0] in read}
        if name.startswith(AID_SOURCE_TOPIC) or name not in INNOVATION_TOPICS:
            topics[name, instance] = table
    return flight.with_topics(topics)


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


def write_onboard(path: AnyPath, samples: Mapping[SourceAxis, AxisSamples]) -> None:
    """Write the vehicle's own innovations in the layout of `<set>.innovations.parquet`."""
    keys = sorted(samples)
    names = list(dict.fromkeys(source for source, _ in keys))
    with tables_in_groups(path, ONBOARD_SCHEMA) as write:
        for source, axis in keys:
            one = samples[source, axis]
            index = np.full(one.timestamp_sample.size, names.index(source), np.int32)
            columns = {
                "source": pa.DictionaryArray.from_arrays(pa.array(index), pa.array(names, pa.string())),
                "axis": pa.array(np.full(index.size, axis, np.int32)),
                "timestamp_sample": pa.array(one.timestamp_sample),
                **{name: pa.array(getattr(one, name)) for name in _FIELDS},
                "innovation_rejected": pa.array(one.rejected),
                "fused": pa.array(one.fused),
            }
            write(pa.table(columns, schema=ONBOARD_SCHEMA))
