"""All parameters that the estimator of a release reads, of a log and of a set that a study gives."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    ParameterError,
    as_float32,
    as_read_by,
    defaults_of,
    migrate,
    older_names,
    parameters_of,
)
from fusetune.px4.parameters.parameter_migration import older_values
from fusetune.px4.parameters.release_names import on_vehicle
from fusetune.px4.parameters.set_names import demand_had
from fusetune.px4.releases import BASELINE, Release, name_of

_NOTHING: Mapping[str, float] = MappingProxyType({})


def complete(
    logged: Mapping[str, float | int],
    overrides: Mapping[str, float | int],
    release: Release | None = None,
    replayed: Release = BASELINE,
    given: Mapping[str, float | int] = _NOTHING,
) -> dict[str, float]:
    """All parameters that the estimator of a release reads: overrides before logged ones before its defaults.

    Where it is v1.13 it has, beside those of v1.16, its own that became others, and each tells the other: what the
    log has counts, and an override of v1.16 sets those of v1.13 by which it comes out as wanted.

    Parameters
    ----------
    logged
        Parameters of the log, in the names of its own release.
    overrides
        Parameters of a set, in the names of `parameters_of` the replayed release.
    release
        Firmware release of the log.
    replayed
        Whose estimator reads them.
    given
        Parameters that count before logged ones, of a vehicle of the replayed release; what that lacks has no effect.

    Raises
    ------
    ParameterError
        The replayed release has no such parameter as an override, under whatever name, or no value of it that does
        the same.
    """
    read, older = parameters_of(replayed), older_names(replayed)
    for name in overrides:
        demand_had(name, replayed)
    values = dict(defaults_of(replayed)) | migrate(logged, release, replayed)
    if older:
        values |= older_values(values, logged)
    values |= {name: as_float32(float(value)) for name, value in given.items() if name in read}
    if older:
        values |= {name: value for name, value in older_values(values, given).items() if name not in given}
        values |= _as_wanted(values, overrides, older, replayed)
    values |= {name: as_float32(float(value)) for name, value in overrides.items()}
    return values


def _as_wanted(
    values: Mapping[str, float], overrides: Mapping[str, float | int], older: tuple[str, ...], replayed: Release
) -> dict[str, float]:
    """The parameters that became others as overrides have them or ask for them, and what they tell, as float32."""
    own = {name: overrides.get(name, values[name]) for name in older}
    told = as_read_by(own, replayed).keys() - own.keys()
    wanted = {name: float(value) for name, value in overrides.items() if name in told}
    for name in overrides.keys() & own.keys():
        twice = ", ".join(sorted(wanted.keys() & {*ALL_PARAMETERS[name].became}))
        if twice:
            raise ParameterError(name, f"is what {name_of(replayed)} has for {twice}, also given", "Give one of them")
    found, refused = on_vehicle(wanted, own, replayed)
    if refused:
        raise ParameterError(refused[0].name, refused[0].reason, refused[0].remedy)
    own |= {one.name: one.value for one in found}
    return {name: as_float32(float(value)) for name, value in as_read_by(own, replayed).items()}
