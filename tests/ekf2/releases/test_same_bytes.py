"""Releases cost v1.16 nothing: what it computes are the bytes it computed before there were any.

Expected: digests of v1.16's results at d0e4755, the commit before; to be renewed with what is meant to change them.
"""

from __future__ import annotations

import hashlib

import llvmlite.binding
import numba
import pytest
from numba.core import config

from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.filter.common.parameters import complete
from fusetune.ekf2.replay.replay import replay
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog

MEASURED_ON = ("znver4", "0.68.1")
"""Processor and Numba: others choose other instructions, and the last digit with them."""


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="Numba is switched off")
@pytest.mark.skipif(
    (llvmlite.binding.get_host_cpu_name(), numba.__version__) != MEASURED_ON, reason="the digests are another machine's"
)
@pytest.mark.parametrize(
    ("name", "digest"), [("mc_flow", "38be50b72bcc72a508887cf6"), ("fw_airspeed", "167dea7b5d671cbae76d34e1")]
)
def test_the_results_of_v1_16_are_the_same_bytes(golden_logs, name, digest):
    flight = canonical(read_ulog(golden_logs / f"{name}.ulg"))
    result = replay(build_inputs(flight), complete(flight.parameters.initial, {}, flight.release))
    found = hashlib.sha256()
    for rows in (result.innovations, result.states, result.local_position, result.flags):
        found.update(rows.tobytes())
    assert found.hexdigest()[:24] == digest
