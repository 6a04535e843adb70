"""How close one replay is to another: figures per aid source and axis, for states, flags and resets.

`compare_folders` sets a replay beside a reference in the same file layout, for example what PX4's own estimator
computed. Only what comes after the first fused GNSS sample counts (the first fused aid, without GNSS): before it
there is no local origin, and innovations mean nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.set_input import existing_folder
from fusetune.errors import UserError
from fusetune.px4.aid_sources import AID_SOURCES, OLD_SOURCES, REPLAYED_SOURCES
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

NOT_AN_AID = tuple(one.name for one in AID_SOURCES.values() if one.every_update or not one.measures)
COMPARED_SOURCES = (
    *(name for name in REPLAYED_SOURCES if AID_SOURCES[name].is_replayed and name not in NOT_AN_AID),
    *OLD_SOURCES,
)
NLL_SOURCES = tuple(one.name for one in AID_SOURCES.values() if one.orders_sets)
MIN_SAMPLES = 10
NLL_CAP = 50.0
"""A single sample weighs no more than this in the sum that orders sets, so that one outlier decides nothing."""
REMEDY = "Make the folder again: fusetune replay"


@dataclass(frozen=True)
class AxisFidelity:
    """One axis of one aid source."""

    source: str
    axis: int
    samples: int
    relative_rms: float
    """RMS of the innovation difference over RMS of the reference's innovation."""
    variance_difference: float
    """Median relative difference of the innovation variance."""
    fused_equal: float
    rejected_equal: float
    """Share of samples with the same decision."""
    nll_difference: float
    """Difference of the mean negative log-likelihood per sample."""


@dataclass(frozen=True)
class ReplayFidelity:
    """One replay against its reference."""

    set: str
    axes: tuple[AxisFidelity, ...]
    missing: float
    """Share of the reference's samples that the replay does not have."""
    flags_equal: float
    """Share of time in which every control status flag agrees."""
    differing_flags: tuple[str, ...]
    """Control status flags that ever differ, longest first."""
    resets_equal: bool
    velocity_rms: float
    attitude_rms_deg: float
    gyro_bias_rms: float
    nll_reference: float
    nll_replay: float

    @property
    def median_relative_rms(self) -> float:
        return float(np.median([axis.relative_rms for axis in self.axes])) if self.axes else float("nan")

    @property
    def worst(self) -> AxisFidelity | None:
        """The axis with the largest relative difference."""
        return max(self.axes, key=lambda axis: axis.relative_rms, default=None)


@dataclass(frozen=True)
class Innovations:
    """Innovation rows of one replay or log as columns."""

    source: np.ndarray
    axis: np.ndarray
    timestamp: np.ndarray
    innovation: np.ndarray
    variance: np.ndarray
    rejected: np.ndarray
    fused: np.ndarray

    def rows(self, selected: np.ndarray) -> Innovations:
        return Innovations(*(getattr(self, name)[selected] for name in self.__dataclass_fields__))


def compare_folders(reference: AnyPath, replay: AnyPath) -> list[ReplayFidelity]:
    """Compare every set of a reference folder that the replay folder also holds.

    Raises
    ------
    UserError
        A folder does not exist; the reference folder holds no set, or the replay folder none of its sets; a file of a
        set is damaged, or lacks what is compared.
    """
    reference = existing_folder(reference, "Name the folder of one flight's reference")
    replay = existing_folder(replay, REMEDY)
    suffix = ".innovations.parquet"
    sets = sorted(path.name.removesuffix(suffix) for path in reference.glob("*" + suffix))
    if not sets:
        raise UserError(reference, f"holds no SET{suffix}", "Name the folder of one flight's reference")
    common = [name for name in sets if (replay / (name + suffix)).exists()]
    if not common:
        raise UserError(replay, f"holds none of the sets {', '.join(sets)}", "Replay them first: fusetune replay")
    return [_compared(reference, replay, name) for name in common]


def _compared(reference: Path, replay: Path, name: str) -> ReplayFidelity:
    try:
        return compare_set(reference, replay, name)
    except (LookupError, ValueError, TypeError) as error:
        reason = f"its set {name}, or that of {reference}, lacks what is compared ({error})"
        raise UserError(replay, reason, REMEDY) from error


def order_agreement(results: list[ReplayFidelity]) -> float:
    """Kendall τ between the orders in which reference and replay put the sets by total NLL; NaN below three sets."""
    if len(results) < 3:
        return float("nan")
    from scipy.stats import kendalltau

    tau = kendalltau([r.nll_reference for r in results], [r.nll_replay for r in results])
    return float(tau.statistic)


def compare_set(reference: AnyPath, replay: AnyPath, name: str) -> ReplayFidelity:
    """Compare one set of two folders."""
    reference, replay = Path(reference), Path(replay)
    ref, rep = (_innovations(_read(folder, f"{name}.innovations.parquet")) for folder in (reference, replay))
    start = comparison_start(ref)
    # An innovation that is no number, as of a vision system that measures no height, cannot be repeated.
    usable = (ref.variance > 0) & np.isfinite(ref.innovation)
    ref = ref.rows((ref.timestamp >= start) & np.isin(ref.source, COMPARED_SOURCES) & usable)
    ours, theirs, missing = _match(ref, rep)
    axes = tuple(
        _axis_fidelity(source, axis, ours.rows(rows), theirs.rows(rows))
        for source in COMPARED_SOURCES
        for axis in range(3)
        if (rows := (theirs.source == source) & (theirs.axis == axis)).sum() >= MIN_SAMPLES
    )
    flags_equal, differing = _flags_fidelity(reference, replay, name, start)
    velocity, attitude, gyro_bias = _state_fidelity(reference, replay, name, start)
    return ReplayFidelity(
        set=name,
        axes=axes,
        missing=missing,
        flags_equal=flags_equal,
        differing_flags=differing,
        resets_equal=_resets(reference, name) == _resets(replay, name),
        velocity_rms=velocity,
        attitude_rms_deg=attitude,
        gyro_bias_rms=gyro_bias,
        nll_reference=_total_nll(theirs),
        nll_replay=_total_nll(ours),
    )


def load_innovations(path: AnyPath) -> Innovations:
    """Read a `<set>.innovations.parquet`; innovations of reconstructed samples are left out."""
    return _innovations(read_table(path, sealed=False))


def _read(folder: Path, name: str, columns: list[str] | None = None) -> pa.Table:
    """A table of one of the folders compared, which another program may have written."""
    return read_table(folder / name, columns, remedy=REMEDY, sealed=False)


def _innovations(table: pa.Table) -> Innovations:
    if "measured" in table.column_names:
        table = table.filter(table["measured"])

    def column(name: str, dtype: type) -> np.ndarray:
        return table.column(name).to_numpy().astype(dtype)

    return Innovations(
        source=_names(table.column("source")),
        axis=column("axis", np.int64),
        timestamp=column("timestamp_sample", np.int64),
        innovation=column("innovation", np.float64),
        variance=column("innovation_variance", np.float64),
        rejected=column("innovation_rejected", bool),
        fused=column("fused", bool),
    )


def _names(column: pa.ChunkedArray) -> np.ndarray:
    """Text column as NumPy strings, quickly where it is dictionary-encoded."""
    coded = column.combine_chunks()
    if not pa.types.is_dictionary(coded.type):
        coded = coded.dictionary_encode()
    return np.array(coded.dictionary.to_pylist(), dtype=str)[coded.indices.to_numpy()]


def comparison_start(rows: Innovations) -> int:
    """Time (µs) of the first fused GNSS sample, or of the first fused aid where GNSS is never fused."""
    candidates = rows.fused & np.isin(rows.source, ("gnss_vel", "gnss_pos"))
    if not candidates.any():
        candidates = rows.fused & ~np.isin(rows.source, NOT_AN_AID)
    if not candidates.any():
        return int(rows.timestamp.max(initial=0))
    return int(rows.timestamp[candidates].min())


def _match(ref: Innovations, rep: Innovations) -> tuple[Innovations, Innovations, float]:
    """Rows of replay and reference with the same source, axis and sample time; and the share without partner."""
    ref_keys, ref_rows = np.unique(_keys(ref), return_index=True)
    rep_keys, rep_rows = np.unique(_keys(rep), return_index=True)
    _, in_ref, in_rep = np.intersect1d(ref_keys, rep_keys, assume_unique=True, return_indices=True)
    missing = 1.0 - len(in_ref) / len(ref_keys) if len(ref_keys) else 1.0
    return rep.rows(rep_rows[in_rep]), ref.rows(ref_rows[in_ref]), missing


def _keys(rows: Innovations) -> np.ndarray:
    """One number per source, axis and sample time; rows of other sources get one of their own."""
    key = -1 - np.arange(len(rows.axis), dtype=np.int64)
    for code, source in enumerate(COMPARED_SOURCES):
        selected = rows.source == source
        key[selected] = (rows.timestamp[selected] * len(COMPARED_SOURCES) + code) * 4 + rows.axis[selected]
    return key


def _axis_fidelity(source: str, axis: int, ours: Innovations, theirs: Innovations) -> AxisFidelity:
    rms = np.sqrt(np.mean(theirs.innovation**2))
    return AxisFidelity(
        source=source,
        axis=axis,
        samples=len(theirs.axis),
        relative_rms=float(np.sqrt(np.mean((ours.innovation - theirs.innovation) ** 2)) / max(rms, 1e-12)),
        variance_difference=float(np.median(np.abs(ours.variance / theirs.variance - 1.0))),
        fused_equal=float(np.mean(ours.fused == theirs.fused)),
        rejected_equal=float(np.mean(ours.rejected == theirs.rejected)),
        nll_difference=abs(mean_nll(ours.innovation, ours.variance) - mean_nll(theirs.innovation, theirs.variance)),
    )


def _nll(innovation: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Gaussian negative log-likelihood of each innovation."""
    return 0.5 * (innovation**2 / variance + np.log(2.0 * np.pi * variance))


def mean_nll(innovation: np.ndarray, variance: np.ndarray) -> float:
    """Mean negative log-likelihood per sample."""
    return float(np.mean(_nll(innovation, variance)))


def _total_nll(rows: Innovations) -> float:
    """Sum over sources and axes of the mean capped NLL."""
    nll = np.minimum(_nll(rows.innovation, rows.variance), NLL_CAP)
    total = 0.0
    for source in NLL_SOURCES:
        for axis in range(3):
            selected = (rows.source == source) & (rows.axis == axis)
            total += float(nll[selected].mean()) if selected.any() else 0.0
    return total


def _state_fidelity(reference: Path, replay: Path, name: str, start: int) -> tuple[float, float, float]:
    """RMS difference of velocity (m/s), attitude (deg) and gyro bias (rad/s) at common times."""
    columns = ["timestamp_sample"] + [f"states_{i}" for i in range(13)]
    ref, rep = (
        np.column_stack([_read(folder, f"{name}.states.parquet", [c])[c].to_numpy() for c in columns])
        for folder in (reference, replay)
    )
    _, i, j = np.intersect1d(ref[:, 0], rep[:, 0], return_indices=True)
    i, j = i[ref[i, 0] >= start], j[ref[i, 0] >= start]
    if not len(i):
        return float("nan"), float("nan"), float("nan")
    difference = rep[j] - ref[i]
    velocity = float(np.sqrt(np.mean(np.sum(difference[:, 5:8] ** 2, axis=1))))
    gyro_bias = float(np.sqrt(np.mean(np.sum(difference[:, 11:14] ** 2, axis=1))))
    same_sign = np.sign(np.sum(ref[i, 1:5] * rep[j, 1:5], axis=1, keepdims=True))
    chord = np.linalg.norm(ref[i, 1:5] - same_sign * rep[j, 1:5], axis=1)
    angle = np.degrees(4.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))
    return velocity, float(np.sqrt(np.mean(angle**2))), gyro_bias


def _flags_fidelity(reference: Path, replay: Path, name: str, start: int) -> tuple[float, tuple[str, ...]]:
    """Share of time after `start` in which all control status flags agree, and the names of those that do not."""
    ref, rep = (_read(folder, f"{name}.status_flags.parquet") for folder in (reference, replay))
    names = [column for column in ref.column_names if column.startswith("cs_") and column in rep.column_names]
    ref_t, rep_t = ref["timestamp"].to_numpy(), rep["timestamp"].to_numpy()
    if not len(ref_t) or not len(rep_t):
        return float("nan"), ()
    times = np.unique(np.concatenate([ref_t, rep_t, [start]]))
    times = times[times >= max(start, int(ref_t[0]), int(rep_t[0]))]
    if len(times) < 2:
        return float("nan"), ()
    span = np.diff(times)
    ref_row = np.searchsorted(ref_t, times[:-1], side="right") - 1
    rep_row = np.searchsorted(rep_t, times[:-1], side="right") - 1
    differs = np.column_stack([ref[column].to_numpy()[ref_row] != rep[column].to_numpy()[rep_row] for column in names])
    share = (differs * span[:, None]).sum(axis=0) / span.sum()
    worst = np.argsort(-share)
    equal = 1.0 - float((differs.any(axis=1) * span).sum() / span.sum())
    return equal, tuple(names[k] for k in worst if share[k] > 0)


def _resets(folder: Path, name: str) -> object:
    return read_document(folder / f"{name}.json", remedy=REMEDY, sealed=False)["resets"]
