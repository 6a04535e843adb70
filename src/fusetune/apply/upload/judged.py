"""What is to be written, and for which vehicle and which present values it was judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.apply.parameter_files.names import ROLLBACK
from fusetune.apply.upload.values import Type, Value
from fusetune.errors import RUN_AGAIN, UserError
from fusetune.px4.parameters.params_file import ParamEntry, read_params
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath, sha256_of

DECISION = "decision.json"
ROLLBACK_FILE = f"{ROLLBACK}.params"


@dataclass(frozen=True)
class Judged:
    """Values to write.

    Attributes
    ----------
    wanted : new values by name
    present : of every parameter that was judged, what the vehicle flew with
    uuid : of the board that flew; empty where the logs tell none
    vehicle : in words
    simulated : what was simulated, "SITL" or "HITL"; empty of a real vehicle
    release : that flew, such as "v1.16.0"
    """

    file: Path
    wanted: Mapping[str, Value]
    present: Mapping[str, Value]
    uuid: str
    vehicle: str
    simulated: str
    release: str


def read_judged(file: AnyPath) -> Judged:
    """Read a parameter file with the decision beside it that it belongs to.

    Raises
    ------
    UserError
        One cannot be read, they do not belong together, nothing is to be written, or the decision is of no vehicle
        that something can be written to.
    """
    file = Path(file)
    decision_file = file.with_name(DECISION)
    if not decision_file.exists():
        raise UserError(
            decision_file,
            f"does not exist; it says for which vehicle {file.name} is, and which values it was judged against",
            "Upload the file where the pipeline wrote it",
        )
    entries = read_params(file)
    decision = read_document(decision_file)
    try:
        if decision["parameter_files"][file.name] != sha256_of(file):
            raise UserError(file, "is no longer as the decision beside it wrote it", RUN_AGAIN)
        return _judged(file, entries, decision)
    except (KeyError, TypeError, AttributeError) as error:
        raise UserError(decision_file, f"does not say what an upload needs ({error})", RUN_AGAIN) from error


def _judged(file: Path, entries: Sequence[ParamEntry], decision: dict[str, Any]) -> Judged:
    vehicle = decision["vehicle"]
    if not entries or vehicle is None:
        raise UserError(file, "changes nothing", "There is nothing to upload: fly on with the present parameters")
    if vehicle["kind"] == "SITL" and vehicle["hardware"] != "PX4_SITL":
        raise UserError(file, "is for a vehicle that only fusetune simulated", "Upload what real flights decided")
    flown = vehicle["present_flight"]
    release = next(one["firmware"] for one in decision["flights"] if one["flight"] == flown)
    on_vehicle = decision["on_vehicle"]
    wanted = {entry.name: Value.of(entry.type, entry.value) for entry in entries}
    known = {name: Value.of(_type(number), number) for name, number in on_vehicle["judged"].items()}
    # what a rollback undoes is what the change wrote
    now = "value" if file.name == ROLLBACK_FILE else "previous"
    known |= {one["name"]: Value.of(one["type"], one[now]) for one in on_vehicle["parameters"]}
    return Judged(
        file,
        wanted,
        known,
        vehicle["uuid"],
        vehicle["in_words"],
        "" if vehicle["kind"] == "real" else vehicle["kind"],
        release or "unknown",
    )


def _type(number: float) -> Type:
    return "INT32" if isinstance(number, int) else "FLOAT"
