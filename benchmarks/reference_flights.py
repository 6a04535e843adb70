"""Where logs and what PX4's own estimator computed on them stand: the golden flights of the project, or others."""

from __future__ import annotations

import lzma
from pathlib import Path

from fusetune.analyze.replaying.set_input import existing_folder
from fusetune.errors import UserError

GOLDEN = Path(__file__).resolve().parents[1] / "tests/golden"
GOLDEN_LOGS, GOLDEN_REFERENCE = GOLDEN / "logs", GOLDEN / "reference"


def reference_folders(reference: Path) -> list[Path]:
    """Folders of the flights below a reference folder, by name.

    Raises
    ------
    UserError
        There is no such folder, or no flight in it.
    """
    remedy = "Name the folder that holds one folder per flight, as docs/fidelity.md describes it"
    folders = sorted(path for path in existing_folder(reference, remedy).iterdir() if any(path.glob("*.json")))
    if not folders:
        raise UserError(reference, "holds no reference of a flight", remedy)
    return folders


def log_of(flight: str, logs: Path, scratch: Path) -> Path:
    """The log of a flight: `FLIGHT.ulg` of the folder, or `FLIGHT.ulg.xz` unpacked into `scratch`.

    Raises
    ------
    UserError
        The folder holds neither, or what is packed is damaged.
    """
    log, packed = logs / f"{flight}.ulg", logs / f"{flight}.ulg.xz"
    if log.exists() or not packed.exists():
        existing_folder(logs, "Name the folder of the logs")
        return log
    try:
        content = lzma.decompress(packed.read_bytes())
    except (lzma.LZMAError, EOFError) as error:
        raise UserError(packed, f"cannot be unpacked: {error}", "Get the file again") from error
    unpacked = scratch / log.name
    unpacked.write_bytes(content)
    return unpacked
