"""What `present` and `as_flown` mean, and which sets are replayed and scored on a flight.

* `present` is what the vehicle flies now: its parameters at the end of one flight, the newest unless told otherwise.
  All other sets are compared with it. Of these parameters those count that the study varies; in all others a set
  leaves each log as it is.
* `as_flown` is each log's own parameters, without exception. It is replayed to be compared with what the vehicle's own
  estimator logged, and is not scored.

Rules of the workflow ask this module, too: what needs the saved flights is imported where it is needed.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from fusetune.errors import UserError
from fusetune.set_names import AS_FLOWN, PRESENT, mended_name
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import atomic_path

_DELAY = "_DELAY"


@dataclass(frozen=True)
class FlightSets:
    """The sets that every flight is replayed with.

    Attributes
    ----------
    study : sets of the study, name → values of the parameters that it varies
    """

    study: Mapping[str, Mapping[str, float]]

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
        return sorted({name for overrides in self.study.values() for name in overrides})

    def overrides(self, names: Collection[str], present: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """The values that some of the sets give to parameters, by set.

        Parameters
        ----------
        present : those of the present set, `Present.parameters`
        """
        known = {**self.study, PRESENT: present, AS_FLOWN: {}}
        return {name: dict(known[name]) for name in names}

    @property
    def mendable(self) -> list[str]:
        """Names of the scored sets that can be compared with mended delays, too: those that vary none themselves."""
        study = [name for name, values in self.study.items() if not any(one.endswith(_DELAY) for one in values)]
        return [PRESENT, *study]

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
        mended = {mended_name(name): ", ".join(filter(None, (plain.get(name), "delays mended"))) for name in self.mendable}
        return {**descriptions, **mended}


@dataclass(frozen=True)
class Present:
    """Where the present values come from, and those that the study varies.

    Attributes
    ----------
    flight : None where no flight can be replayed
    checksum : of the flight's log
    parameters : name → value, sorted by name; those of the study's parameters that the log knows
    """

    flight: str | None
    checksum: str | None
    parameters: dict[str, float]


def find_present(
    rows: Sequence[Mapping[str, Any]],
    folders: Mapping[str, str | os.PathLike[str]],
    varied: Collection[str],
    wanted: str | None,
) -> Present:
    """Find the flight whose parameters count as the present ones.

    Parameters
    ----------
    rows : `flight`, `status` and `recorded` of every flight
    folders : of the saved flights, by name
    varied : names of the parameters that the study varies
    wanted : name of the flight; None for the one recorded last, of several the last by name

    Raises
    ------
    UserError
        The wanted flight cannot be replayed.
    """
    replayable = [row for row in rows if row["status"] == "replayable"]
    if wanted is None:
        if not replayable:
            return Present(None, None, {})
        wanted = str(max(replayable, key=lambda row: (row["recorded"], row["flight"]))["flight"])
    elif wanted not in [row["flight"] for row in replayable]:
        raise UserError(
            "present_flight",
            f"{wanted!r} is no flight that can be replayed",
            "Name one that results/save/flights.csv calls replayable, or none for the newest",
        )
    from fusetune.save.flight_folder import read_metadata

    metadata = read_metadata(folders[wanted])
    values = metadata["ekf2_parameters"]
    return Present(wanted, metadata["checksum"], {name: values[name] for name in sorted(set(varied) & values.keys())})


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
    document = read_document(file)
    try:
        return Present(**document)
    except TypeError as error:
        reason = f"does not say what the vehicle flies now ({error})"
        raise UserError(file, reason, "Delete it and run the pipeline again") from error
