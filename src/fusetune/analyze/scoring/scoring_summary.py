"""What `scoring.json` says of a flight: what was scored of it, and how each set fared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import SourceAxis
from fusetune.analyze.scoring.activity import inactive_parameters, same_results
from fusetune.analyze.scoring.filter_events import FilterEvents
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.sensors.source_whiteness import Whiteness
from fusetune.finding import documents
from fusetune.px4.aid_sources import AXES
from fusetune.px4.flight import Flight


def flight_summary(
    flight: Flight,
    present: str,
    window: ScoringWindow,
    whiteness: Mapping[SourceAxis, Whiteness],
    settings: ScoringSettings,
) -> dict[str, Any]:
    """What was scored of a flight, as JSON can hold it; its sets are to be added.

    Parameters
    ----------
    whiteness : of the sources, as the present set sees it
    """
    return {
        "flight": flight.name,
        "status": "scored" if window.intervals else "not_scored",
        "reason": window.reason,
        "checksum": flight.checksum,
        "firmware": flight.release_name,
        "present": present,
        "scored_s": round(window.duration_s, 3),
        "warm_up_end_us": window.warm_up_end,
        "intervals_us": [list(interval) for interval in window.intervals],
        "block_edges_us": window.block_edges(settings.block_s).tolist() if window.intervals else [],
        "cuts": documents(cut.finding for cut in window.cuts),
        "white_share": {
            f"{source}.{AXES[axis]}": round(one.white_share, 4)
            for (source, axis), one in whiteness.items()
            if np.isfinite(one.white_share)
        },
    }


def set_summary(
    record: ReplayedSet, present: ReplayedSet, window: ScoringWindow, events: FilterEvents, flight: Flight
) -> dict[str, Any]:
    """How a set fared, as JSON can hold it.

    Parameters
    ----------
    window : as the set sees it
    events : in the flight after its warm-up
    """
    excluded = window.excluded.get(record.name, "")
    ok = record.status == "ok"
    outcome = "excluded" if excluded else "scored" if window.intervals else "not_scored"
    return {
        "status": outcome if ok else record.status,
        "reason": excluded,
        "overrides": record.overrides,
        "parameters": record.parameters,
        "flight_s": round(events.flight_s, 3),
        "resets": events.resets,
        "reset_jumps": {kind: asdict(jumps) for kind, jumps in events.jumps.items()},
        "significant_resets": events.significant_resets,
        "timeouts": {name: count for name, count in events.timeouts.items() if count},
        "faults": list(events.faults),
        "fault_s": {name: round(seconds, 3) for name, seconds in events.fault_s.items()},
        "fault_flags": events.fault_flags,
        "dead_reckoning_s": round(events.dead_reckoning_s, 3),
        "same_results_as_present": record is not present and ok and same_results(record, present),
        "inactive": inactive_parameters(record, present, flight) if ok and record is not present else {},
    }
