"""How a log lays out the state vector of EKF2 and the variances beside it, recognised from the log itself.

PX4 changed the vector five times, and development builds carry the number of the release before or after, so the
release says little. What says it: how many states and variances there are, whether the vehicle's place is among the
states, and whether the biases are rates.

====================  ======  =========  ==============  =======================  ========================
since                 states  variances  of the attitude  biases                   position
====================  ======  =========  ==============  =======================  ========================
v1.8                  24      24         quaternion (4)  increments per update    in the local frame
July 2023             24      24         quaternion (4)  rates                    in the local frame
October 2023, v1.15   24      23         rotation (3)    rates                    in the local frame
May 2024              25      24         rotation (3)    rates                    in the local frame, terrain
October 2024, v1.16   25      24         rotation (3)    rates                    height only, terrain
====================  ======  =========  ==============  =======================  ========================

Source: history of `msg/EstimatorStates.msg` (until v1.11 `msg/estimator_status.msg`) and of EKF2's state vector.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.px4.flight import TopicTable, field_names, row_count, stacked

UPDATE_INTERVAL_S = 0.01
"""Update interval of the estimator in the releases whose bias states are increments per update."""

_STATE_COUNTS = (24, 25)
_BIAS_RATES, _AXES = ("gyro_bias", "accel_bias"), 3
_BIASES = slice(10, 16)
_ACCEL_BIAS_VARIANCES = slice(13, 16)
"""Of a vector that begins with the four variances of a quaternion."""

_RATE_NOT_INCREMENT = 0.1
"""Of the ratio of bias states to the biases that the log tells as rates: between the update interval (s) and 1."""

_MAX_INCREMENT_VARIANCE = (0.5 * UPDATE_INTERVAL_S) ** 2
"""(m/s)²: EKF2_ABIAS_INIT is at most 0.5 m/s². Biases as rates never come to be known so well along all three axes."""


_MIN_SHARE_WITH_PLACE = 0.1
"""Of rows with a horizontal position: where that is no state, it is zero throughout, but for damage."""


@dataclass(frozen=True)
class StateLayout:
    """What stands where in `states` and `covariances`.

    Attributes
    ----------
    states, variances : how many of each are in use
    has_rotation_variances : of the attitude, three of a rotation in NED; else four of the quaternion
    has_bias_rates : biases in rad/s and m/s²; else rad and m/s per update
    has_local_position : states 7 to 9 are the position in the local frame; else only the last is used, the height
    """

    states: int
    variances: int
    has_rotation_variances: bool
    has_bias_rates: bool
    has_local_position: bool


def state_layout(table: TopicTable, sensor_bias: TopicTable | None = None) -> StateLayout | None:
    """Layout of `estimator_states`; None where it is that of no release.

    Parameters
    ----------
    table : with at least one row
    sensor_bias : `estimator_sensor_bias` of the same instance, which tells the biases as rates
    """
    states, variances = state_counts(table)
    if states not in _STATE_COUNTS or variances not in (states - 1, states):
        return None
    has_rotation = variances == states - 1
    place = stacked(table, "states")[:, 7:9]
    has_place = bool(np.mean(np.isfinite(place).all(axis=1) & np.any(place, axis=1)) > _MIN_SHARE_WITH_PLACE)
    return StateLayout(
        states=states,
        variances=variances,
        has_rotation_variances=has_rotation,
        # the error state came after the biases had become rates
        has_bias_rates=has_rotation or _has_bias_rates(table, sensor_bias),
        has_local_position=states == min(_STATE_COUNTS) or has_place,
    )


def state_counts(table: TopicTable) -> tuple[int, int]:
    """How many states are in use and how many variances there are; `n_states` of v1.6 and damaged ones say nothing."""
    states, variances = len(field_names(table, "states")), len(field_names(table, "covariances"))
    told = float(np.median(table["n_states"])) if "n_states" in table else 0.0
    used = int(told) if 0.0 < told <= states else states
    return used, min(variances, used)


def tells_bias_rates(sensor_bias: TopicTable) -> bool:
    """Whether `estimator_sensor_bias` holds both biases, as rates."""
    return bool(row_count(sensor_bias)) and all(len(field_names(sensor_bias, name)) == _AXES for name in _BIAS_RATES)


def _has_bias_rates(table: TopicTable, sensor_bias: TopicTable | None) -> bool:
    if sensor_bias is not None and tells_bias_rates(sensor_bias):
        nearest = np.searchsorted(sensor_bias["timestamp"], table["timestamp"]).clip(0, row_count(sensor_bias) - 1)
        rates = np.linalg.norm(np.hstack([stacked(sensor_bias, name)[nearest] for name in _BIAS_RATES]), axis=1)
        biases = np.linalg.norm(stacked(table, "states")[:, _BIASES], axis=1)
        known = np.isfinite(rates) & np.isfinite(biases) & (rates > 0.0) & (biases > 0.0)
        if known.any():
            return bool(np.median(biases[known] / rates[known]) > _RATE_NOT_INCREMENT)
    largest = stacked(table, "covariances")[:, _ACCEL_BIAS_VARIANCES].max(axis=1)
    known = largest[np.isfinite(largest)]
    return bool(len(known) and np.median(known) > _MAX_INCREMENT_VARIANCE)
