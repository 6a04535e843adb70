"""What `present` and `as_flown` mean, and which sets are replayed and scored on a flight.

* `present` is what the vehicle flies now: its parameters at the end of one flight, the newest that counts unless told
  otherwise. That flight also says which vehicle is decided for.
  All other sets are compared with it. Of these parameters those count that the study varies; in all others a set
  leaves each log as it is.
* `as_flown` is each log's own parameters, without exception. It is replayed to be compared with what the vehicle's own
  estimator logged, and is not scored.

Rules of the workflow ask this module, too: what needs the saved flights is imported where it is needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

from fusetune.design.around_present import AroundPresent, study_around
from fusetune.design.parameter_sets import ParameterSet
from fusetune.design.tunable_parameters import DELAY_SUFFIX
from fusetune.errors import UserError
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.set_names import AS_FLOWN, EFFECT_SETS, PRESENT, mended_name
from fusetune.storage.documents import read_as, write_document
from fusetune.storage.files import atomic_path


@dataclass(frozen=True)
class FlightSets:
    """The sets that every flight is replayed with.

    Attributes
    ----------
    study : sets of the study, name → values of the parameters that it varies
    around : parameters that are varied around the present values; the sets are known when the flights are listed
    searched : parameters that a set of a search may change; the sets are known when it has ended
    effects : sets that take single effects as the flights measure them, name → values; known when all have told
    """

    study: Mapping[str, Mapping[str, float]]
    around: Collection[str] = ()
    searched: Collection[str] = ()
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def found(self, present: Present) -> FlightSets:
        """The same with the sets around the present values that the flights led to."""
        return replace(self, study={**self.study, **{one.name: one.overrides for one in present.sets}})

    @property
    def scored(self) -> list[str]:
        """Names of the sets that are scored and ranked, the present one first."""
        return [PRESENT, *self.study]

    @property
    def replayed(self) -> list[str]:
        """Names of the sets that are replayed."""
        return [*self.scored, AS_FLOWN]

    @property
    def varied(self) -> list[str]:
        """Names of the parameters that the study varies, sorted."""
        return sorted(
            {name for overrides in self.study.values() for name in overrides}.union(self.around, self.searched)
        )

    def overrides(self, names: Collection[str], present: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """The values that some of the sets give to parameters, by set.

        Parameters
        ----------
        present : those of the present set, `Present.parameters`
        """
        of_effects = {name: {**present, **values} for name, values in self.effects.items()}
        known = {**self.study, **of_effects, PRESENT: present, AS_FLOWN: {}}
        return {name: dict(known[name]) for name in names}

    @property
    def mendable(self) -> list[str]:
        """Names of the scored sets that can be compared with mended delays, too: those that vary none themselves.

        Of sets with equal values the first alone: the others would be it once more. None beside a search that finds
        delays as well: what is mended is found with all else.
        """
        if any(name.endswith(DELAY_SUFFIX) for name in self.searched):
            return []
        first: dict[tuple[tuple[str, float], ...], str] = {}
        for name, values in self.study.items():
            if not any(one.endswith(DELAY_SUFFIX) for one in values):
                first.setdefault(tuple(sorted(values.items())), name)
        return [PRESENT, *first.values()]

    def mended(
        self, names: Collection[str], present: Mapping[str, float], delays: Mapping[str, float]
    ) -> dict[str, dict[str, float]]:
        """The values of some of the sets with the delays mended, by the name that each has then.

        Parameters
        ----------
        present : those of the present set, `Present.parameters`
        delays : delay parameters and the values that mend them
        """
        return {mended_name(name): {**values, **delays} for name, values in self.overrides(names, present).items()}

    def described(self, descriptions: Mapping[str, str]) -> dict[str, str]:
        """A line about each set, those with mended delays, too."""
        plain = {PRESENT: "the configuration that flies now", **descriptions}
        effects = {
            name: f"the {EFFECT_SETS[name].replace('_', ' ')} as the flights measure it" for name in self.effects
        }
        mended = {
            mended_name(name): ", ".join(filter(None, ({**plain, **effects}.get(name), "delays mended")))
            for name in (*self.mendable, *effects)
        }
        return {**descriptions, **effects, **mended}


@dataclass(frozen=True)
class Present:
    """Where the present values come from, and those that the study varies.

    Attributes
    ----------
    flight : None where no flight can be replayed
    checksum : of the flight's log
    parameters : name → value, sorted by name; those of the study's parameters that the log knows
    same : all flights of the vehicle that have these values, the newest first
    sets : of a study around these values, one step from them each
    left_out : parameter, or set, that such a study could have had → why it does not
    """

    flight: str | None
    checksum: str | None
    parameters: dict[str, float]
    same: Sequence[str] = ()
    sets: Sequence[ParameterSet] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Candidate:
    """A flight that can be replayed."""

    flight: str
    vehicle: VehicleIdentity
    recorded: str
    may_be_scored: bool
    folder: str | os.PathLike[str]
    varied: Collection[str]

    @cached_property
    def metadata(self) -> dict[str, Any]:
        from fusetune.save.flight_folder import read_metadata

        return read_metadata(self.folder)

    @property
    def values(self) -> dict[str, float]:
        """Those that the study varies, at the end of the flight."""
        return {name: self.parameters[name] for name in sorted(set(self.varied) & self.parameters.keys())}

    @property
    def parameters(self) -> Mapping[str, float]:
        """All of the estimator, at the end of the flight."""
        values: Mapping[str, float] = self.metadata["ekf2_parameters"]
        return values

    def is_like(self, other: _Candidate) -> bool:
        """Whether it does not matter which of the two is taken."""
        return self.vehicle.is_same(other.vehicle) and self.values == other.values


def find_present(
    rows: Sequence[Mapping[str, Any]],
    folders: Mapping[str, str | os.PathLike[str]],
    varied: Collection[str],
    wanted: str | None,
    vehicle: str | None = None,
    counts: Callable[[str], bool] = lambda flight: True,
    around: Collection[str] = (),
) -> Present:
    """Find the flight whose parameters count as the present ones; its vehicle is the one that is decided for.

    Where neither flight nor vehicle is wanted, it is the newest real flight, or the newest simulated one where none is
    real. One that does not count in the decision is passed over for the next where that makes a difference: another
    vehicle, or other values.

    Parameters
    ----------
    rows : `flight`, `status`, `recorded`, `airborne_s` and the columns of `VehicleIdentity` of every flight
    folders : of the saved flights, by name
    varied : names of the parameters that the study varies
    wanted : name of the flight; None for the one recorded last, of several the last by name
    vehicle : name or id of the vehicle, or how it begins; None for any
    counts : whether the replay of a flight is trusted enough to decide; costs a replay, so it is asked of few
    around : parameters that are varied around what is found

    Raises
    ------
    UserError
        The wanted flight or vehicle has no flight that can be replayed, or several vehicles are meant.
    """
    found = [
        _Candidate(
            row["flight"],
            VehicleIdentity.from_row(row),
            row["recorded"],
            row.get("airborne_s") != 0.0,
            folders[row["flight"]],
            varied,
        )
        for row in rows
        if row["status"] == "replayable"
    ]
    found.sort(key=lambda one: (one.recorded, one.flight), reverse=True)
    if vehicle is not None:
        found = _of_vehicle(found, vehicle)
    chosen = _wanted(found, wanted, vehicle) if wanted is not None else _newest(found, counts)
    if chosen is None:
        return Present(None, None, {})
    same = tuple(one.flight for one in found if one.is_like(chosen))
    present = Present(chosen.flight, chosen.metadata["checksum"], chosen.values, same)
    if not around:
        return present
    study = _around(chosen, [one for one in found if one.vehicle.is_same(chosen.vehicle)], around)
    return replace(present, sets=study.sets, left_out=study.left_out)


def _around(chosen: _Candidate, flights: Sequence[_Candidate], around: Collection[str]) -> AroundPresent:
    """Sets around what flies now. Where the logs of the vehicle differ in one of the parameters, every set gives it the
    present value, so that no two differ in more than what they vary; else a log keeps what it says."""
    from fusetune.save.exercise import exercise_of

    differing = {
        name: value
        for name, value in chosen.values.items()
        if any(one.parameters.get(name) != value for one in flights)
    }
    return study_around(chosen.parameters, list(around), [exercise_of(one.folder) for one in flights], differing)


def _of_vehicle(found: Sequence[_Candidate], vehicle: str) -> list[_Candidate]:
    of_it = [one for one in found if one.vehicle.is_called(vehicle)]
    others = sorted({one.vehicle.name for one in (of_it or found)})
    if not of_it:
        reason = f"{vehicle!r} has no flight that can be replayed"
        known = f"Name one of {', '.join(others)}" if others else "Add flights of it"
        raise UserError("vehicle", reason, f"{known}, or none for that of the newest flight")
    if not all(one.vehicle.is_same(of_it[0].vehicle) for one in of_it):
        raise UserError(
            "vehicle",
            f"{vehicle!r} can mean {', '.join(others)}",
            "Write more of its name or id, see results/save/flights.csv",
        )
    return of_it


def _wanted(found: Sequence[_Candidate], wanted: str, vehicle: str | None) -> _Candidate:
    for one in found:
        if one.flight == wanted:
            return one
    raise UserError(
        "present_flight",
        f"{wanted!r} is no flight {'' if vehicle is None else f'of {vehicle} '}that can be replayed",
        "Name one that results/save/flights.csv calls replayable, or none for the newest",
    )


def _newest(found: Sequence[_Candidate], counts: Callable[[str], bool]) -> _Candidate | None:
    """The newest that counts, of those that come first in question."""
    for preferred in (
        [one for one in found if one.vehicle.is_real and one.may_be_scored],
        [one for one in found if one.vehicle.is_real],
        [one for one in found if one.may_be_scored],
        found,
    ):
        if not preferred:
            continue
        first = preferred[0]
        if all(first.is_like(other) for other in preferred):
            return first
        return next((one for one in preferred if counts(one.flight)), first)
    return None


def write_present(file: str | os.PathLike[str], present: Present) -> None:
    """Write what was found as JSON."""
    with atomic_path(file) as temporary:
        write_document(temporary, asdict(present))


def read_present(file: str | os.PathLike[str]) -> Present:
    """Read what `write_present` wrote.

    Raises
    ------
    UserError
        There is none, or it cannot be read.
    """
    return read_as(file, _present_of, "what the vehicle flies now")


def _present_of(document: dict[str, Any]) -> Present:
    sets = tuple(ParameterSet(**one) for one in document.get("sets", ()))
    return Present(**document | {"same": tuple(document["same"]), "sets": sets})
