"""What was predicted while a sensor was withheld, from the metrics of all flights."""

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd

from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.report.results import Results

_METRIC = re.compile(r"withheld_rms_([0-9.e+-]+)s")


@dataclass(frozen=True)
class Withheld:
    """A source that is predicted while its sensor is withheld, and the axes whose errors are joined."""

    source: str
    axes: tuple[str, ...]
    label: str

    @property
    def unit(self) -> str:
        return AID_SOURCES[self.source].unit


POSITION = Withheld("gnss_pos", ("x", "y"), "horizontal position without GNSS")
VELOCITY = Withheld("gnss_vel", ("x", "y"), "horizontal velocity without GNSS")
HEIGHT = Withheld("gnss_hgt", ("x",), "GNSS height without GNSS")
BAROMETER = Withheld("baro_hgt", ("x",), "height without barometer")
MAGNETOMETER = Withheld("mag", ("x", "y", "z"), "magnetic field without magnetometer")


def drift(results: Results, withheld: Withheld) -> pd.DataFrame:
    """RMS drift of each shown set on each flight, joined over the axes.

    Returns
    -------
    Columns flight, set, horizon_s and drift (unit of the source); empty where nothing was withheld
    """
    metrics, places = results.figure_rows
    found = [
        rows
        for (source, axis, metric), rows in places.items()
        if source == withheld.source and axis in withheld.axes and _METRIC.fullmatch(metric)
    ]
    if not found:
        return pd.DataFrame({"flight": [], "set": [], "horizon_s": [], "drift": []})
    rows = metrics.take(np.sort(np.concatenate(found)))
    squares = pd.DataFrame(
        {
            "flight": rows["flight"].astype(str),
            "set": rows["set"].astype(str),
            "horizon_s": [_horizon(metric) for metric in rows["metric"]],
            "square": np.square(rows["value"].to_numpy(np.float64)),
        }
    )
    grouped = squares.groupby(["flight", "set", "horizon_s"])["square"].agg(["sum", "size"])
    complete = grouped[grouped["size"] == len(withheld.axes)].reset_index()
    return pd.DataFrame(
        {
            "flight": complete["flight"],
            "set": complete["set"],
            "horizon_s": complete["horizon_s"],
            "drift": np.sqrt(complete["sum"]),
        }
    )


def _horizon(metric: str) -> float:
    match = _METRIC.fullmatch(metric)
    return float(match[1]) if match else float("nan")


def gap_lengths(table: pd.DataFrame) -> pd.Series:
    """Length of the gaps of each flight, s, from its `drift`: their last horizon. Short flights have shorter gaps."""
    return table.groupby("flight")["horizon_s"].max()


def usual_gap_length(lengths: pd.Series) -> float:
    """What most flights have, the longest of several."""
    return float(lengths.mode().max())


def drift_summary(results: Results, withheld: Withheld) -> pd.DataFrame:
    """Drift of each set over the flights whose gaps are as long as those of most: means of others are of other times.

    Returns
    -------
    Indexed by set and horizon_s: mean, low and high quartile over the flights, number of flights; `change`, the mean
    over the flights of the change against the present set (percent), and `change_low`, `change_high`, one standard
    error below and above. The changes are means of logarithms, as the score is.
    """
    table = drift(results, withheld)
    columns = ["mean", "low", "high", "flights", "change", "change_low", "change_high"]
    if table.empty:
        return pd.DataFrame(columns=columns)
    lengths = gap_lengths(table)
    table = table[table["flight"].isin(lengths.index[lengths == usual_gap_length(lengths)])]
    base = table[table["set"] == results.present].rename(columns={"drift": "base"})
    paired = table.merge(base[["flight", "horizon_s", "base"]], on=["flight", "horizon_s"], how="left")
    with np.errstate(divide="ignore", invalid="ignore"):
        paired["log_ratio"] = np.log(paired["drift"] / paired["base"])
    grouped = paired.groupby(["set", "horizon_s"])
    ratio = grouped["log_ratio"].mean()
    error = grouped["log_ratio"].sem().fillna(0.0)  # one flight alone has none
    return pd.DataFrame(
        {
            "mean": grouped["drift"].mean(),
            "low": grouped["drift"].quantile(0.25),
            "high": grouped["drift"].quantile(0.75),
            "flights": grouped["drift"].size(),
            "change": 100.0 * np.expm1(ratio),
            "change_low": 100.0 * np.expm1(ratio - error),
            "change_high": 100.0 * np.expm1(ratio + error),
        }
    )
