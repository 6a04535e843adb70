"""The sheet `ranking.csv`: a row for each parameter set, in the order of the ranking.

It has the columns of `ranking.parquet`, with units in their names and without lists: what is held against a set is one
text, and of the kinds of prediction in which it is worse each has a column.
"""

from __future__ import annotations

from collections.abc import Sequence

import pyarrow as pa
import pyarrow.compute as pc

from fusetune.apply.evidence import AIMS
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.storage.sheet import SheetColumn

_UNITS = {"m": "m", "m/s": "m_s", "rad": "rad", "G": "gauss", "rad/s": "rad_s", "m/s^2": "m_s2", "m/s²": "m_s2"}

_OF_THE_SET = (
    SheetColumn("rank", "place in the ranking, from 1"),
    SheetColumn("set", "name of the parameter set", "name"),
    SheetColumn("status", "its part in the decision"),
    SheetColumn("reasons", "what is held against it, or why it was not scored, in words"),
    SheetColumn("score_nat", "mean score over the flights; lower is better", "score"),
    SheetColumn("difference_nat", "score less that of the present set; below 0 is better", "difference"),
    SheetColumn("difference_lower_nat", "lower end of its interval", "lower"),
    SheetColumn("difference_upper_nat", "upper end of its interval", "upper"),
    SheetColumn("difference_error_nat", "standard error of the difference", "error"),
    SheetColumn("expected_difference_nat", "what is to be expected of it, as the best of many", "expected"),
    SheetColumn("error_change_percent", "change of the typical prediction error; below 0 is smaller"),
    SheetColumn("p_value", "of the difference against 0, for this set alone"),
    SheetColumn("p_holm", "the same by Holm's correction for all candidates"),
    SheetColumn("p_family", "that the best of the candidates is so much better by luck"),
    SheetColumn("bound_nat", "upper end of the wider interval by which a change is decided", "bound"),
    SheetColumn("velocity_bound_nat", "the same of the smoothed velocity alone", "velocity_bound"),
    SheetColumn("p_velocity", "as `p_family`, of the smoothed velocity alone"),
    SheetColumn("p_best", "share of the bootstrap's draws in which no set that may be flown scores lower"),
    SheetColumn("flights", "number of flights behind the score"),
    SheetColumn("flights_better", "on how many of them it beats the present set"),
    SheetColumn("equal_to_present", "whether its results are the same on every flight"),
    SheetColumn("behind_best_nat", "score less that of the best set", "behind_best"),
    SheetColumn("behind_best_error_nat", "standard error of that", "behind_best_error"),
    *(SheetColumn(f"worse_{aim}", f"whether it is worse beyond doubt in the kind `{aim}`") for aim in AIMS),
    SheetColumn("evidence_lost_percent", "how much of the evidence it lacks, and is charged for"),
    *(
        SheetColumn(f"{aim}_{figure}_nat", f"{words}, in the kind `{aim}` alone", f"{aim}_{figure}")
        for aim in AIMS
        for figure, words in (
            ("difference", "difference"),
            ("lower", "lower end of its interval"),
            ("upper", "upper end of its interval"),
        )
    ),
)  # fmt: skip

_OF_A_SOURCE = {
    "rms_{source}_horizontal": ("rms_{source}_horizontal_{unit}", "RMS innovation of the source, horizontal"),
    "rms_{source}_vertical": ("rms_{source}_vertical_{unit}", "the same, vertical"),
    "nll_{source}": ("nll_{source}_nat", "negative log-likelihood of its innovations per sample"),
    "mean_nis_{source}": ("mean_nis_{source}", "mean normalised innovation squared"),
    "j_nis_{source}": ("j_nis_{source}", "distance of that from what is expected"),
    "c_nis_{source}": ("c_nis_{source}", "that and the distance of its variance"),
    "lag1_{source}": ("lag1_{source}", "correlation of successive normalised innovations"),
}

_OF_ALL = (
    SheetColumn(
        "true_velocity_rmse_m_s", "true error of velocity, where the logs know the truth", "true_velocity_rmse"
    ),
    SheetColumn("true_position_rmse_m", "true error of position", "true_position_rmse"),
    SheetColumn("true_position_rmse_mean_removed_m", "the same less its mean", "true_position_rmse_mean_removed"),
    SheetColumn("true_attitude_rmse_deg", "true error of attitude"),
    SheetColumn(
        "nll_all_sources_nat", "negative log-likelihood per sample, summed over all sources", "nll_all_sources"
    ),
    SheetColumn("break_rate_gate", "share of innovations beyond their gate"),
    SheetColumn("paper_aggregate_rms", "the paper's RMS of position, height and velocity innovations together"),
    SheetColumn("resets", "number of resets on all flights"),
    SheetColumn("timeouts", "number of time-outs on all flights"),
    SheetColumn("faults", "number of flights with fault flags"),
)


def ranking_sheet(source: str) -> tuple[SheetColumn, ...]:
    """Columns of the sheet; `source` is the one that the other criteria are about."""
    unit = next(_UNITS.get(one.unit, one.unit) for one in AID_SOURCES.values() if one.name == source)
    of_source = (
        SheetColumn(name.format(source=source, unit=unit), words, of.format(source=source))
        for of, (name, words) in _OF_A_SOURCE.items()
    )
    return (*_OF_THE_SET, *of_source, *_OF_ALL)


def sheet_of_ranking(table: pa.Table, source: str) -> tuple[pa.Table, Sequence[SheetColumn]]:
    """The table of `ranking.parquet` with what its lists hold in columns of their own, and the columns of the sheet."""
    worse = [text.split() for text in table["worse_aims"].to_pylist()]
    for aim in AIMS:
        table = table.append_column(f"worse_{aim}", pa.array([aim in kinds for kinds in worse]))
    change = pc.negate(table["improvement_percent"])
    return table.append_column("error_change_percent", change), ranking_sheet(source)
