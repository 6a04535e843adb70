"""Writes the data of a flight's views.

`write_blob(flight_folder, analyze_folder, small, large)` reads, of a log that was analysed,

* `results/save/<flight>/`: the topics that `logged` names, and `metadata.json`;
* `results/analyze/<flight>/`: `health.json`, `diagnosis.json`, `effects.json` (of every log), `track.parquet` and
  `conformance.json`; of a flight that was replayed `scoring.json`, `scores.parquet`, `samples.parquet`,
  `onboard.innovations.parquet` and the tables of `present.*` and `as_flown.*`. What is not there is not shown, and no
  error.

It writes two blobs (`blob`): `small`, for the report of all flights, and `large`, for the page of the flight. Nothing
of a decision is read; a page that knows it puts it into a blob with `with_choice`, which leaves the arrays as they are.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from fusetune.report.flight_data.blob import read_header, with_header
from fusetune.report.flight_data.flight_content import flight_content
from fusetune.report.flight_data.packing import LARGE_BUDGET_BYTES, SMALL_BUDGET_BYTES, fits, pack_content
from fusetune.report.flight_data.series_colours import coloured
from fusetune.report.flight_data.shown_sets import Choice
from fusetune.report.set_styles import SetStyle
from fusetune.save.flight_folder import METADATA_FILE, read_flight_document
from fusetune.storage.files import AnyPath, atomic_path


def pack_flight(
    flight_folder: AnyPath,
    analyze_folder: AnyPath,
    budget_bytes: int = LARGE_BUDGET_BYTES,
    sets: Sequence[str] = (),
) -> bytes | None:
    """The blob of a flight whose base64 takes no more than the budget; None of a log of which nothing could be read.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    analyze_folder : `results/analyze/<flight>`
    sets : that are told first behind the present one, in this order; the others that were scored follow, of too many
        those that predict the flight best

    Raises
    ------
    UserError
        A file is missing or damaged.
    """
    if not is_readable(flight_folder):
        return None
    return pack_content(flight_content(flight_folder, analyze_folder, sets), budget_bytes)


def write_blob(
    flight_folder: AnyPath,
    analyze_folder: AnyPath,
    small: AnyPath,
    large: AnyPath | None = None,
    sets: Sequence[str] = (),
) -> bool:
    """Write the blobs of a flight; parameters and errors are those of `pack_flight`.

    Parameters
    ----------
    small, large : take the blob for the report and the one for the flight's own page; of a log of which nothing could
        be read both are empty

    Returns
    -------
    Whether there is something to show.
    """
    content = flight_content(flight_folder, analyze_folder, sets) if is_readable(flight_folder) else None
    blob = b""
    # what is not thinned for the larger one, and small, is the same for both
    for target, budget in ((large, LARGE_BUDGET_BYTES), (small, SMALL_BUDGET_BYTES)):
        if content is not None and (not blob or not fits(blob, budget)):
            blob = pack_content(content, budget)
        if target is not None:
            with atomic_path(target) as path:
                path.write_bytes(blob)
    return content is not None


def with_choice(
    blob: bytes, chosen: str | None, ruled_out: Collection[str] = (), styles: Mapping[str, SetStyle] | None = None
) -> bytes:
    """A blob whose sets have the parts, and the looks, that the decision gave them.

    Parameters
    ----------
    chosen : the recommended set; None, or the present one, where that stays
    ruled_out : sets that cannot be chosen
    styles : looks of the sets in all figures; those that it lacks keep theirs

    Raises
    ------
    UserError
        It is no blob.
    """
    header = read_header(blob)
    sets = header["sets"]
    present = next((one["name"] for one in sets if one["role"] == "present"), "")
    choice, looks = Choice(chosen, frozenset(ruled_out)), styles or {}

    def changed(one: dict[str, Any]) -> dict[str, Any]:
        look = looks.get(one["name"])
        style = {} if look is None else {"style": look.index, "marker": look.marker}
        return one | {"role": choice.role_of(one["name"], present)} | style

    decided = [changed(one) for one in sets]
    return with_header(blob, {"sets": decided, "panels": coloured(header["panels"], decided)})


def is_readable(flight_folder: AnyPath) -> bool:
    """Whether anything of the log could be read."""
    return "topics" in read_flight_document(Path(flight_folder) / METADATA_FILE)
