"""A decision as the pipeline writes it, with its parameter files, and a vehicle that it is for."""

from __future__ import annotations

import random
import struct
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fusetune.apply.parameter_changes import parameter_changes
from fusetune.apply.parameter_files.vehicle_changes import vehicle_changes
from fusetune.apply.parameter_files.vehicle_parameters import VehicleParameters
from fusetune.apply.parameter_files.write_files import FilesOrigin, write_parameter_files
from fusetune.apply.provenance import file_hash
from fusetune.apply.rounded import rounded
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.px4.releases import BASELINE
from fusetune.storage.documents import write_document

UUID = "00010000000020343457544e5015003a0043"
RELEASE, VERSION = "v1.16.0", 0x011000FF
NEW: Mapping[str, float] = {
    "EKF2_ACC_NOISE": 0.7,
    "EKF2_BARO_NOISE": 2.0,
    "EKF2_GPS_CHECK": 21.0,
    "EKF2_GPS_DELAY": 40.0,
    "EKF2_GPS_V_NOISE": 0.075,
    "EKF2_GYR_NOISE": 0.1,
    "EKF2_HGT_REF": 0.0,
    "EKF2_MAG_NOISE": 0.03,
}
"""Six numbers and two whole ones; two of them take a reboot."""
_ODD = {
    "TST_NAN": ("FLOAT", 0x7FC00000), "TST_DENORMAL": ("FLOAT", 0x00000001), "TST_TINY": ("FLOAT", 0x1E3CE508),
    "TST_ID": ("INT32", 0x7F800001), "TST_NEGATIVE": ("INT32", 0xFFFFFFFF),
}  # fmt: skip
"""What a float field, or a text, carries badly: no number, the smallest, and the bytes of a signalling NaN."""


def write_decision(folder: Path, *, uuid: str = UUID, release: str = RELEASE, **vehicle: str) -> Path:
    """Write `decision.json`, `best_params.params` and `rollback.params`; returns the second."""
    folder.mkdir(parents=True, exist_ok=True)
    previous = {name: PARAMETERS[name].default for name in NEW}
    changes = parameter_changes(NEW, previous)
    values = {name: int(one.default) if one.type == "INT32" else one.default for name, one in PARAMETERS.items()}
    has = VehicleParameters(values, release=BASELINE, firmware=release)
    told = vehicle_changes(changes, has)
    written = write_parameter_files(folder, told, has, FilesOrigin(("a trial",), "made for a trial", "flight_1"))
    who = {"name": "trial", "in_words": "quadrotor trial", "uuid": uuid, "hardware": "PX4_FMU_V4", "airframe": "4011"}
    decision: dict[str, Any] = {
        "status": "change",
        "chosen": "made",
        "present": "present",
        "changes": [asdict(one) for one in changes],
        "vehicle": {**who, "type": "quadrotor", "kind": "real", "present_flight": "flight_1", **vehicle},
        "on_vehicle": told.document() | {"judged": has.judged},
        "flights": [{"flight": "flight_1", "firmware": release}],
        "parameter_files": {file.name: file_hash(file) for file in written},
    }
    write_document(folder / "decision.json", rounded(decision))
    return folder / "best_params.params"


def made_values(count: int, seed: int = 1, odd: bool = True) -> dict[str, tuple[str, int]]:
    """Type and bits of all EKF2 parameters at their defaults, and of others up to a number."""
    chance = random.Random(seed)
    values = {name: (one.type, _bits(one.type, one.default)) for name, one in PARAMETERS.items()}
    values |= _ODD if odd else {}
    for number in range(count - len(values)):
        kind = chance.choice(("FLOAT", "INT32"))
        drawn = chance.uniform(-100.0, 100.0) if kind == "FLOAT" else chance.randrange(-(2**24), 2**24)
        values[f"TST_{number:04d}"] = (kind, _bits(kind, drawn))
    return values


def old_and_new() -> dict[str, tuple[int, int]]:
    """Bits of each parameter that the decision changes, before and after."""
    kinds = {name: PARAMETERS[name].type for name in NEW}
    return {name: (_bits(kinds[name], PARAMETERS[name].default), _bits(kinds[name], new)) for name, new in NEW.items()}


def _bits(kind: str, number: float) -> int:
    packed = struct.pack("<i", int(number)) if kind == "INT32" else struct.pack("<f", number)
    return int(struct.unpack("<I", packed)[0])
