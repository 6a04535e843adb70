"""Parameters of a set, given in the names of any release, as the estimator of the replayed one reads them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    BECAME,
    PARAMETERS,
    ParameterError,
    ParameterMetadata,
    as_read_by,
    is_had_by,
    metadata_of,
    parameters_of,
)
from fusetune.px4.releases import BASELINE, Release, estimator_name

Value = TypeVar("Value")

GOES_ALONG = "EKF2_DELAY_MAX"

NEWER_NAMES: Mapping[str, str] = {
    name: told[0]
    for name, told in BECAME.items()
    if len(told) == 1 and (name not in ALL_PARAMETERS or ALL_PARAMETERS[name].first_release > BASELINE)
}
"""What newer releases call a parameter of the baseline → the name that it has there; the meaning is the same."""


def read_by(name: str, replayed: Release = BASELINE) -> ParameterMetadata:
    """Metadata of a parameter that the estimator of a release reads, under that release's name or the baseline's.

    Raises
    ------
    ParameterError
        It reads none of that name; the remedy names the releases that do, or what to give instead.
    """
    known_name = NEWER_NAMES.get(name, name)
    known = parameters_of(replayed).get(known_name)
    if known is not None:
        demand_had(known_name, replayed)
        return known
    other = ALL_PARAMETERS.get(name)
    if other is None or other.became or name in PARAMETERS:
        return metadata_of(name)
    raise _not_had(other, replayed)


def demand_had(name: str, replayed: Release) -> None:
    """See that a release has a parameter, under the name of the baseline or those that it became another of.

    EKF2_DELAY_MAX goes along with a delay, and is taken without effect where the delays alone size the buffers.

    Raises
    ------
    ParameterError
        It has not, or there is no such parameter; the remedy names the releases that do.
    """
    if name not in parameters_of(replayed):
        metadata_of(name)
    if replayed[:2] != BASELINE and name != GOES_ALONG and not is_had_by(name, replayed):
        raise _not_had(ALL_PARAMETERS[name], replayed)


def _not_had(metadata: ParameterMetadata, replayed: Release) -> ParameterError:
    first, last = estimator_name(metadata.first_release), estimator_name(metadata.last_release)
    having = f"only {first} has it" if first == last else f"{first} to {last} have it"
    reason = f"{estimator_name(replayed)} has no such parameter, {having}"
    return ParameterError(metadata.name, reason, "Leave it out, or ask for the replay of a release that has it")


def in_baseline_names(values: Mapping[str, Value]) -> dict[str, Value]:
    """The values under the names of the baseline, where newer releases only call them otherwise.

    Raises
    ------
    ParameterError
        A parameter is given under both names.
    """
    for name in values:
        if name in NEWER_NAMES and NEWER_NAMES[name] in values:
            reason = f"is what newer releases call {NEWER_NAMES[name]}, which is given, too"
            raise ParameterError(name, reason, "Give one of them")
    return {NEWER_NAMES.get(name, name): value for name, value in values.items()}


def of_vehicle(values: Mapping[str, float], replayed: Release) -> dict[str, float]:
    """All parameters of a vehicle of a release as its estimator reads them; what it does not read is left out."""
    read = parameters_of(replayed)
    taken = values if values.keys() <= read.keys() else as_read_by(values, replayed)
    return {name: float(value) for name, value in taken.items() if name in read}
