"""One section on one revision, in a process of its own: prints what it found as one line of JSON."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from pathlib import Path

from benchmarks.speed.calibration import loop_s
from benchmarks.speed.quantities import Failed, Lacking
from benchmarks.speed.workplace import Workplace


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("section")
    for name in ("tree", "scratch", "kept"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--cores", type=int, required=True)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    work = Workplace(options.tree, options.scratch, options.kept, options.quick, options.cores)
    section = importlib.import_module(f"benchmarks.speed.sections.{options.section}")
    found: dict[str, float] = {}
    lacking, failed = "", ""
    before = loop_s()
    try:
        for name, value in section.measure(work):
            found[name] = value
    except Lacking as error:
        lacking = str(error)
    except (AttributeError, Failed, ImportError, TypeError) as error:
        # also what an older revision does not have yet, or has under another name
        failed = f"{type(error).__name__}: {error}"
    told = {"values": found, "lacking": lacking, "failed": failed, "loop_s": 0.5 * (before + loop_s())}
    print(json.dumps(told), file=sys.stdout)


if __name__ == "__main__":
    main()
