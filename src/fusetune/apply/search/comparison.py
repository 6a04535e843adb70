"""Sets that were tried on flights, compared with their base: the evidence of the decision, out of what was tried."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.analyze.trials.tried_set import ONE_STEP, SMOOTHED, WITHHELD, Column, TriedSet
from fusetune.apply.evidence import AIMS, BlockSums, FlightEvidence, flight_evidence
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.vetoes import break_reasons, event_reasons
from fusetune.px4.aid_sources import AXES

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TriedBase:
    """A base on a flight.

    Attributes
    ----------
    reason : why nothing can be compared there; empty where it can
    whiteness : how white the error of each source is as it sees it, 0 … 1
    tried : itself
    place : how late the GNSS receiver is and where its antenna sits; None where the flight does not tell
    """

    reason: str
    whiteness: Mapping[str, float]
    tried: TriedSet
    place: VelocityPlace | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """N sets on F flights.

    Attributes
    ----------
    differences : (N, F) score less that of the base, nat; NaN where a set has none, or the flight says nothing
    aims : the same in each kind of prediction that the flight has; NaN elsewhere
    objections : (N,) what speaks against each set beside its score
    places : (F,) what each flight tells of the GNSS receiver, whatever the set; empty where nothing does
    """

    differences: Array
    aims: Mapping[str, Array]
    objections: tuple[tuple[str, ...], ...]
    places: tuple[VelocityPlace | None, ...] = ()

    @property
    def usable(self) -> npt.NDArray[np.bool_]:
        """(F,) flights that say anything."""
        return np.asarray(np.isfinite(self.differences).any(axis=0))

    @property
    def means(self) -> Array:
        """(N,) mean differences over the flights that say anything; NaN of sets that lack one, or if there is none."""
        if not self.usable.any():
            return np.full(len(self.differences), np.nan)
        return np.asarray(self.differences[:, self.usable].mean(axis=1))


def compare(bases: Sequence[TriedBase], tried: Sequence[Sequence[TriedSet]], settings: DecisionSettings) -> Comparison:
    """Compare sets with their base.

    Parameters
    ----------
    bases : of F flights of one vehicle; a source whose whiteness a flight cannot show has the mean of the others'
    tried : of each of N sets, what it did on the flights
    """
    number, flights = len(tried), len(bases)
    differences = np.full((number, flights), np.nan)
    aims = {aim: np.full((number, flights), np.nan) for aim in AIMS}
    usual = _usual(bases)
    for column, base in enumerate(bases):
        evidence = _evidence(base, [row[column] for row in tried], usual, settings)
        if evidence is None or "-1" not in evidence.sets:
            continue
        rows = [int(name) for name in evidence.sets if name != "-1"]
        names = ["-1", *map(str, rows)]
        differences[rows, column] = evidence.differences(names)[1:]
        for aim in evidence.aims:
            aims[aim.name][rows, column] = evidence.differences(names, aim.name)[1:]
    objections = tuple(_objections(bases, row, settings) for row in tried)
    return Comparison(differences, aims, objections, tuple(one.place for one in bases))


def _usual(bases: Sequence[TriedBase]) -> dict[str, float]:
    known: dict[str, list[float]] = {}
    for base in bases:
        for source, share in base.whiteness.items():
            known.setdefault(source, []).append(share)
    return {source: float(np.mean(sorted(shares))) for source, shares in known.items()}


def _evidence(
    base: TriedBase, tried: Sequence[TriedSet], usual: Mapping[str, float], settings: DecisionSettings
) -> FlightEvidence | None:
    """The base is named −1, the sets by their place; those that lack a column are left out."""
    if base.reason or not base.tried.sums:
        return None
    named = [("-1", base.tried), *((str(place), one) for place, one in enumerate(tried))]
    complete = [(name, one) for name, one in named if base.tried.sums.keys() <= one.sums.keys()]
    return flight_evidence(
        "", _sums(ONE_STEP, complete), _sums(WITHHELD, complete), {**usual, **base.whiteness}, settings,
        _sums(SMOOTHED, complete),
    )  # fmt: skip


def _sums(kind: str, named: Sequence[tuple[str, TriedSet]]) -> BlockSums | None:
    """The whole flight as one block."""
    columns = [column for column in named[0][1].sums if column.kind == kind]
    if not columns:
        return None
    figures = np.array([[one.sums[column] for column in columns] for _, one in named])
    return BlockSums(
        sets=tuple(name for name, _ in named),
        columns=tuple((column.source, _label(column)) for column in columns),
        n=figures[0, None, :, 0],
        sum_nis=figures[:, None, :, 1],
        sum_log_variance=figures[:, None, :, 2],
    )


def _label(column: Column) -> str:
    """As `fusetune.apply.evidence` labels it."""
    after = f" after {column.horizon_s:g} s" if column.kind == WITHHELD else ""
    return f"{column.source} {AXES[column.axis]}{after}"


def _objections(bases: Sequence[TriedBase], row: Sequence[TriedSet], settings: DecisionSettings) -> tuple[str, ...]:
    flights = [(place, base.tried, one) for place, (base, one) in enumerate(zip(bases, row, strict=True))]
    usable = [(place, base, one) for place, base, one in flights if not bases[place].reason and base.sums]
    failed = [f"flight {place + 1}: {one.reason}" for place, _, one in usable if one.reason]
    lacking = [
        f"flight {place + 1}: lacks too much of what the present set predicts"
        for place, base, one in usable
        if not one.reason and not base.sums.keys() <= one.sums.keys()
    ]
    events = {str(place): (_events(one), _events(base)) for place, base, one in usable if not one.reason}
    rates = {
        (name, source, AXES[axis], str(place)): (found.rejected / found.samples, found.samples)
        for place, base, one in usable
        for name, tried in (("tried", one), ("base", base))
        for (source, axis), found in tried.rejections.items()
        if found.samples
    }
    names = [str(place) for place, _, _ in usable]
    return (
        *failed, *lacking, *event_reasons(events, settings),
        *break_reasons("tried", "base", names, rates, settings.confidence),
    )  # fmt: skip


def _events(tried: TriedSet) -> dict[str, object]:
    return {
        "flight_s": tried.flight_s,
        "significant_resets": tried.significant_resets,
        "timeouts": {"all": tried.timeouts},
        "fault_s": tried.fault_s,
    }
