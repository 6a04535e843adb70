"""Replay parameter sets of a folder straight on a log, beside the pipeline."""

from __future__ import annotations

from pathlib import Path

from fusetune.analyze.replaying.prepared_flight import prepare
from fusetune.analyze.replaying.replay_flight import write_replay
from fusetune.analyze.replaying.set_input import read_set_files
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.errors import OF_DAMAGE, UserError
from fusetune.px4.layouts.estimator_instances import of_one_instance
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.releases import AUTO, number_of_name
from fusetune.px4.ulog.reader import read_ulog
from fusetune.save.replayed_release import replayed_release
from fusetune.storage.files import AnyPath


def replay_log(
    log: AnyPath,
    sets_folder: AnyPath,
    output_folder: AnyPath,
    settings: ReplaySettings | None = None,
) -> list[str]:
    """Replay every set that a folder holds as `SET.json` on one ULog file.

    `params` of each JSON file are the EKF2 parameters used, `overrides` those that differ from the log.

    Parameters
    ----------
    settings : ReplaySettings, optional
        By default the samples are used as they were logged, and the filter, that of v1.16, starts from nothing. No
        gaps are made.

    Returns
    -------
    list of str
        Names of the sets replayed.

    Raises
    ------
    UserError
        The log cannot be read, or a set file is not usable.
    """
    settings = settings or ReplaySettings()
    sets = None if settings.release == AUTO else read_set_files(sets_folder, number_of_name(settings.release))
    flight = read_ulog(log)
    if sets is None:
        sets = read_set_files(sets_folder, replayed_release(flight, settings.release).release)
    Path(output_folder).mkdir(parents=True, exist_ok=True)
    # as PX4's own replay does where nothing is asked for: one estimator instance, from its sensors
    flown = flight if settings.reconstruction is not None else of_one_instance(flight)
    try:
        prepared = prepare(canonical(flown), settings.reconstruction, settings.start, release=settings.release)
    except OF_DAMAGE as error:
        reason = f"cannot be replayed ({type(error).__name__}: {error})"
        raise UserError(log, reason, "See what the command `fusetune save` says of it") from error
    for name, (params, overrides) in sets.items():
        values = prepared.parameters(overrides, params)
        write_replay(prepared, name, overrides, Path(output_folder), params=values)
    return list(sets)
