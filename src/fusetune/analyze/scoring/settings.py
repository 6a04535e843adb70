"""How a flight is scored: the window, the cuts and the blocks."""

from dataclasses import dataclass

from fusetune.settings.declaration import setting


@dataclass(frozen=True)
class ScoringSettings:
    """What of a flight is scored.

    Section `scoring` of the configuration. The same rules hold for all parameter sets of a flight.
    """

    settle_s: float = setting(5.0, "time after aiding starts that is not scored", unit="s", low=0, high=60)
    warm_settle_s: float = setting(1.0, "the same after a warm start", unit="s", low=0, high=60)
    reset_cut_s: float = setting(
        3.0, "time after a reset or a gap in the log that is not scored", unit="s", low=0, high=30
    )
    log_gap_s: float = setting(0.25, "an IMU gap longer than this is cut like a reset", unit="s", low=0.05, high=5)
    block_s: float = setting(10.0, "length of the blocks that the bootstrap draws", unit="s", low=2, high=60)
    window_s: float = setting(30.0, "length of the windows of which the worst is reported", unit="s", low=5, high=300)
    minimum_scored_s: float = setting(5.0, "a flight with less than this is not scored", unit="s", low=1, high=600)
    max_lacking_percent: float = setting(
        20.0,
        "a set that lacks more than this of what the present set predicted of a source is left out there on that "
        "flight; up to it, what it lacks counts with the largest error",
        unit="%",
        low=0,
        high=100,
    )
    confidence: float = setting(0.95, "level of all intervals and bounds of the metrics", low=0.5, high=0.999)
