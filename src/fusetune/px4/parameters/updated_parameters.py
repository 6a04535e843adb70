"""Which parameters a vehicle has after its firmware was brought to another release."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.px4.flight import ParameterHistory
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    as_float32,
    defaults_of,
    is_had_by,
    migrate,
    older_names,
)
from fusetune.px4.parameters.parameter_migration import older_values
from fusetune.px4.releases import BASELINE, Release


def after_update(history: ParameterHistory, flown: Release | None, release: Release) -> dict[str, float]:
    """Parameters that an update to a release changes beside the names, of the log's own, and their new values.

    PX4 stores what differs from the defaults. So what a vehicle has at the default of its release follows the default,
    and what was set stays; defaults of the airframe count as set.

    Parameters
    ----------
    history : parameters of the log, in the names of its release
    flown : that release; None stands for the baseline
    release : that it is brought to

    Returns
    -------
    Values in the names of `parameters_of` the release, of those parameters that come out otherwise than as they flew.
    """
    before = flown or BASELINE
    own, system = migrate(history.initial, before, release), migrate(history.default_system, before, release)
    airframe = migrate(history.default_current_setup, before, release)
    table, new = defaults_of(before[:2]), defaults_of(release[:2])
    followed = {
        name: new[name]
        for name, value in own.items()
        if is_had_by(name, release) and name not in airframe and value == system.get(name, table.get(name))
    }
    return _in_own_names(
        {name: value for name, value in followed.items() if value != own[name]}, history, before, release
    )


def _in_own_names(
    found: dict[str, float], history: ParameterHistory, flown: Release, release: Release
) -> dict[str, float]:
    """The same in the parameters of v1.13 where that is the release and others became of them; the nearest it has."""
    if not older_names(release):
        return found
    values = complete(history.initial, {}, flown, replayed=release) | found
    own = older_values(values, found)
    told = {name for old in own for name in ALL_PARAMETERS[old].became}
    return {name: value for name, value in found.items() if name not in told} | own


def changed_by_update(
    history: ParameterHistory, flown: Release | None, release: Release, overrides: Mapping[str, float]
) -> dict[str, tuple[float | None, float]]:
    """Parameters that differ after an update, or are new: what they were (None: there was none) and what they are.

    Parameters
    ----------
    overrides : from `after_update`, or none where all values are kept
    """
    before = flown or BASELINE
    old = complete(history.initial, {}, before, replayed=before[:2])
    now = complete(history.initial, overrides, before, replayed=release)
    return {
        name: (old.get(name), value) for name, value in now.items() if name not in old or as_float32(old[name]) != value
    }
