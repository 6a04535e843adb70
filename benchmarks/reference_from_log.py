"""Make the reference of one parameter set out of a log in which PX4's own estimator wrote down what it computed.

    python -m benchmarks.reference_from_log LOG.ulg LOG_replayed.ulg REFERENCE_DIR SET

LOG.ulg is what was flown, LOG_replayed.ulg what PX4's replay of it wrote with the values of the set (docs/fidelity.md
says how). The files of the set go to REFERENCE_DIR/LOG/.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.onboard import onboard_samples, write_onboard
from fusetune.ekf2.replay.recording import LOCAL_POSITION_ROW
from fusetune.errors import UserError
from fusetune.px4.flight import Flight, TopicTable, row_count
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.ulog.reader import read_ulog
from fusetune.storage.documents import write_document
from fusetune.storage.files import atomic_path
from fusetune.storage.parquet import write_table

RESET_COUNTERS = tuple(name for name in LOCAL_POSITION_ROW.names or () if name.endswith("_reset_counter"))
REMEDY = "Replay with SDLOG_PROFILE 3 and EKF2_LOG_VERBOSE 1, so that PX4 logs what its estimator computes"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.reference_from_log",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("log", type=Path)
    parser.add_argument("replayed", type=Path)
    parser.add_argument("reference", type=Path)
    parser.add_argument("set")
    options = parser.parse_args(arguments)
    try:
        flown, replayed = read_ulog(options.log), canonical(read_ulog(options.replayed))
        write_reference(options.reference / options.log.stem, options.set, flown, replayed)
    except UserError as error:
        parser.exit(2, f"{error}\n")
    return 0


def write_reference(folder: Path, name: str, flown: Flight, replayed: Flight) -> None:
    """Write the files of one set.

    Parameters
    ----------
    folder : of the flight's reference
    name : of the set
    flown : gives the parameters from which those of the set differ
    replayed : in the layout of `fusetune.px4.layouts.release_layouts.canonical`

    Raises
    ------
    UserError
        The estimator logged no innovations, states, flags or position.
    """
    samples = onboard_samples(replayed, 0)
    if not samples:
        raise UserError(replayed.name, "holds no innovations of an estimator", REMEDY)
    states, flags, position = (
        _topic(replayed, topic) for topic in ("estimator_states", "estimator_status_flags", "vehicle_local_position")
    )
    folder.mkdir(parents=True, exist_ok=True)
    write_onboard(folder / f"{name}.innovations.parquet", samples)
    _write(folder / f"{name}.states.parquet", states, "states")
    _write(folder / f"{name}.status_flags.parquet", flags, "cs_")
    before, used = (complete(flight.parameters.initial, {}, flight.release) for flight in (flown, replayed))
    summary = {
        "version": replayed.release_name,
        "set": name,
        "overrides": {parameter: value for parameter, value in used.items() if value != before[parameter]},
        "params": used,
        "resets": {counter: int(position[counter][-1]) for counter in RESET_COUNTERS},
    }
    with atomic_path(folder / f"{name}.json") as path:
        write_document(path, summary)


def _topic(flight: Flight, name: str) -> TopicTable:
    table = flight.topic(name)
    if table is None or not row_count(table):
        raise UserError(flight.name, f"holds no {name}", REMEDY)
    return table


def _write(path: Path, table: TopicTable, prefix: str) -> None:
    """Times and the columns that begin with `prefix`, `states[3]` as `states_3`."""
    chosen = {
        name.replace("[", "_").rstrip("]"): np.ascontiguousarray(values)
        for name, values in table.items()
        if name.startswith(("timestamp", prefix))
    }
    with atomic_path(path) as temporary:
        write_table(pa.table(chosen), temporary)


if __name__ == "__main__":
    sys.exit(main())
