"""Pages and pictures of flights whose logs were taken away: nothing links to them, and who finds one believes it."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from fusetune.storage.files import AnyPath


def remove_former_flights(folder: AnyPath, flights: Collection[str]) -> list[str]:
    """Remove what a folder of files named by flights holds of others.

    Parameters
    ----------
    folder : such as `results/report/flights`; there may be none
    flights : names of those that are there; all others are removed

    Returns
    -------
    Names of the files that were removed
    """
    files = [one for one in sorted(Path(folder).glob("*")) if one.is_file()]
    # hidden ones are another job's that is not done
    former = [one for one in files if one.stem not in flights and not one.name.startswith(".")]
    for one in former:
        one.unlink(missing_ok=True)
    return [one.name for one in former]
