"""Every set against the present one, as tables that figures and sections share."""

import numpy as np
import numpy.typing as npt
import pandas as pd

from fusetune.apply.evidence import AIDED, AIMS, SMOOTHED, UNAIDED
from fusetune.apply.statistics.rounding import without_rounding
from fusetune.report.results import Results

Array = npt.NDArray[np.float64]

SCORE = "score"
AIM_LABELS = {
    SCORE: "the score that decides",
    AIDED: "aided: one step ahead",
    UNAIDED: "unaided: seconds without GNSS",
    SMOOTHED: "smoothed: velocity",
}
"""What is compared → its label."""

AIM_WORDS = {AIDED: "one step ahead", UNAIDED: "after seconds without GNSS", SMOOTHED: "against the smoothed velocity"}
"""What sets are judged by → when an error is made or against what, within a sentence."""

_HOPELESS = 4.0
_NEVER_HOPELESS = 10.0


def percent_change(difference: npt.ArrayLike) -> Array:
    """Difference of the score as a change of the prediction error, percent; below 0 is better."""
    return 100.0 * np.expm1(np.asarray(difference, dtype=np.float64))


def aim_changes(results: Results, aim: str) -> pd.DataFrame:
    """Change of the prediction error of each set against the present set's, percent.

    Parameters
    ----------
    aim : `SCORE` or one of `AIMS`

    Returns
    -------
    Indexed by set in the order of the ranking, without the present set and sets that have no such figure; columns
    change, lower, upper, status
    """
    prefix = "" if aim == SCORE else f"{aim}_"
    names = {"change": f"{prefix}difference", "lower": f"{prefix}lower", "upper": f"{prefix}upper"}
    ranking = results.ranking[results.ranking["name"] != results.present]
    frame = pd.DataFrame(
        {
            label: percent_change(ranking[column].astype(float)) if column in ranking else np.nan
            for label, column in names.items()
        },
        index=pd.Index(ranking["name"], name="set"),
    )
    frame["status"] = ranking["status"].to_numpy()
    return frame[frame["change"].notna()]


def known_ends(changes: pd.DataFrame, suffix: str = "") -> tuple[pd.Series, pd.Series]:
    """Ends of the intervals, or the change itself where no interval is known."""
    change = changes[f"change{suffix}"]
    return changes[f"lower{suffix}"].fillna(change), changes[f"upper{suffix}"].fillna(change)


def told_aims(results: Results) -> tuple[str, ...]:
    """The kinds of prediction that any flight tells about."""
    return tuple(aim for aim in AIMS if len(aim_changes(results, aim)))


def robust_reach(lower: npt.ArrayLike, upper: npt.ArrayLike, eligible: npt.ArrayLike) -> tuple[float, float]:
    """Limits of an axis that hopeless sets do not squeeze.

    Parameters
    ----------
    lower, upper : ends of the intervals, percent; below 0 is better
    eligible : whether nothing rules a set out; the limits hold the better end of all these

    Returns
    -------
    The lower and the upper limit. The upper one is at most a few times the usual reach (median) of these intervals:
    what lies beyond is so much worse that it matters no more how much.
    """
    low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    able = np.asarray(eligible, bool) & np.isfinite(low) & np.isfinite(high)
    if not able.any():
        able = np.isfinite(low) & np.isfinite(high)
    if not able.any():
        return -1.0, 1.0
    extent = np.sort(np.maximum(np.abs(low[able]), np.abs(high[able])))
    usual = float(extent[(extent.size - 1) // 2])
    limit = max(_HOPELESS * usual, _NEVER_HOPELESS, -float(low[able].min()))
    right = float(np.max(np.minimum(high[low < limit], limit), initial=1.0))
    left = min(float(low[able].min()), -1.0)
    margin = 0.06 * (right - left)
    return left - margin, right + margin


def flight_changes(results: Results, column: str = "score") -> pd.DataFrame:
    """Change of the prediction error on each flight (rows) of each shown set (columns) but the present one, percent.

    Parameters
    ----------
    column : of the table per flight, e.g. "aided_score"
    """
    per_flight = results.per_flight
    if per_flight.empty or column not in per_flight:
        return pd.DataFrame()
    scores = per_flight.pivot(index="flight", columns="set", values=column)
    names = [name for name in results.shown if name in scores.columns and name != results.present]
    differences = without_rounding(scores[names].to_numpy() - scores[[results.present]].to_numpy())
    return pd.DataFrame(percent_change(differences), index=scores.index, columns=names)
