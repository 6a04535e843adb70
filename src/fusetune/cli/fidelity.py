"""`fusetune fidelity`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document

if TYPE_CHECKING:
    from fusetune.analyze.trust.fidelity import ReplayFidelity

HELP = "compare replays with reference replays of the same flight"
EXAMPLES = (("fusetune fidelity reference/flight_1 replays/flight_1", "how near a replay comes to PX4's own"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The two folders."""
    parser.add_argument("reference", type=Path, metavar="REFERENCE_DIR")
    parser.add_argument("replay", type=Path, metavar="REPLAY_DIR")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Compare and print; always `DONE`."""
    from fusetune.analyze.trust.fidelity import compare_folders, order_agreement

    results = compare_folders(options.reference, options.replay)
    tau = order_agreement(results) if len(results) > 2 else None
    if options.json:
        print_document({"sets": results, "order_kendall_tau": tau})
        return DONE
    for result in results:
        _print_fidelity(result)
    if tau is not None:
        print(f"order of the sets by NLL, Kendall tau: {tau:.2f}")
    return DONE


def _print_fidelity(result: ReplayFidelity) -> None:
    print(f"{result.set}")
    print(
        f"  {'source':<16}{'samples':>8}{'RMS diff.':>11}{'variance':>11}{'fused =':>10}{'rejected =':>11}{'NLL':>10}"
    )
    for axis in result.axes:
        print(
            f"  {f'{axis.source}[{axis.axis}]':<16}{axis.samples:>8}{axis.relative_rms:>11.3%}"
            f"{axis.variance_difference:>11.3%}{axis.fused_equal:>11.3%}{axis.rejected_equal:>11.3%}"
            f"{axis.nll_difference:>+11.4f}"
        )
    print(
        f"  flags equal {result.flags_equal:.2%} of the time; resets {'equal' if result.resets_equal else 'differ'}; "
        f"samples without partner {result.missing:.2%}"
    )
    print(
        f"  RMS difference: velocity {result.velocity_rms:.4f} m/s, attitude {result.attitude_rms_deg:.4f} deg, "
        f"gyro bias {result.gyro_bias_rms:.2e} rad/s"
    )
