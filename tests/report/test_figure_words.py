"""Every figure of the health table has words."""

from __future__ import annotations

from pathlib import Path

from fusetune.analyze.health.health_table import health_rows
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.ulog.reader import read_ulog
from fusetune.report.figure_words import figure_words, has_words


def test_words_of_a_source_of_its_parts_and_of_a_sensor() -> None:
    assert (
        figure_words("gnss_vel_horizontal.raised_share") == "GNSS velocity, horizontal: share of test ratios above 0.5"
    )
    assert figure_words("mag.rejected_share") == "magnetometer: share of rejected samples"
    assert figure_words("mag.stuck_s") == "magnetometer: longest time that it stands still in flight"
    assert figure_words("gnss.eph") == "GNSS: horizontal accuracy"


def test_a_figure_without_words_is_spelled() -> None:
    assert figure_words("warp_drive.flux_share") == "warp drive: flux share"
    assert not has_words("warp_drive.flux_share")
    assert not has_words("mag.flux_share")


def test_every_figure_of_a_log_with_several_estimators_has_words(shared_logs: Path) -> None:
    flight = read_ulog(shared_logs / "PX4__sample_multi_ekf_default_params.ulg")
    rows = health_rows(ObservedFlight(flight))
    assert {row.instance for row in rows} >= {0, 1}
    assert not {row.finding.id for row in rows if not has_words(row.finding.id)}
