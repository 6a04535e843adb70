"""The delays that are estimated on saved flights, one line a flight, and what follows of all: docs/delays.md.

python -m benchmarks.delay_estimates results/save/*/
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from fusetune.analyze.delays.sensor_delays import SensorDelay, sensor_delays
from fusetune.analyze.delays.settings import DelaySettings
from fusetune.analyze.delays.wrong_delays import join_delays
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.errors import UserError
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import PRESENT


def delays_of(folder: Path) -> tuple[SensorDelay, ...]:
    """Delays of a saved flight as it was flown."""
    prepared = prepare_flight(load_flight(folder, topics=REPLAY_TOPICS))
    return sensor_delays(prepared, replay_set(prepared, PRESENT, {}))


def main(arguments: Sequence[str] | None = None) -> None:
    """Estimate, print, join."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folders", nargs="+", type=Path, help="results/save/<flight>")
    found: dict[str, tuple[SensorDelay, ...]] = {}
    for folder in parser.parse_args(arguments).folders:
        try:
            found[folder.name] = delays_of(folder)
        except UserError as error:
            print(error)
            continue
        for one in found[folder.name]:
            print(f"{folder.name}: {one.sensor} {one.value_ms} [{one.lower_ms}, {one.upper_ms}], told {one.told_ms:g}")
        if not found[folder.name]:
            print(f"{folder.name}: nothing")
    for joined in join_delays(found, None, DelaySettings()):
        verdict = f"wrong, set {joined.mended_ms:g}" if joined.is_wrong else "not shown to be wrong"
        span = f"[{joined.lower_ms}, {joined.upper_ms}]"
        print(f"{joined.sensor}: {joined.value_ms} {span} from {len(joined.flights)}, {verdict}")


if __name__ == "__main__":
    main()
