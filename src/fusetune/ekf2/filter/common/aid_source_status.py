"""What the estimator knows of one aid source: last observation, innovation, its variance; and the gate test of these.

Mirrors `updateAidSourceStatus` of PX4 v1.16 `EKF/ekf_helper.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.releases.by_release import by_release
from fusetune.px4.aid_sources import AID_SOURCES as SOURCE_ROWS
from fusetune.px4.aid_sources import RECORDED_SOURCES, REPLAYED_SOURCES

AID_SOURCE = np.dtype(
    [
        *fields("i8", "timestamp_sample", "time_last_fuse"),
        *fields("f8", "observation", "observation_variance", shape=(3,)),
        *fields("f8", "innovation", "innovation_filtered", "innovation_variance", shape=(3,)),
        *fields("f8", "test_ratio", "test_ratio_filtered", shape=(3,)),
        *fields("?", "innovation_rejected", "fused"),
    ],
    align=True,
)

AID_SOURCE_NAMES = RECORDED_SOURCES
"""Names of the aid sources of the replay, in the order of their codes; those of older releases alone come last."""

AID_SOURCE_AXES = {name: SOURCE_ROWS[name].axes for name in AID_SOURCE_NAMES}
"""Number of axes of every aid source."""

AID_SOURCES = np.dtype([(name, AID_SOURCE) for name in REPLAYED_SOURCES], align=True)
"""The estimator's sub-record `ekf.aid`: one status for each source."""

OLD_AID_SOURCES = np.dtype([(name, AID_SOURCE) for name in AID_SOURCE_NAMES], align=True)
"""The same until v1.15."""

FILTER_TIME_CONSTANT_S = 0.5
NORMALISED_INNOVATION_LIMIT = 2.0
TEST_RATIO_LIMIT = NORMALISED_INNOVATION_LIMIT**2


@kernel
def set_axis(aid, axis, observation, observation_variance, innovation, innovation_variance):
    """Store one axis of a new observation; `update_aid_source_status` judges all of them."""
    aid.observation[axis] = observation
    aid.observation_variance[axis] = observation_variance
    aid.innovation[axis] = innovation
    aid.innovation_variance[axis] = innovation_variance


@kernel
def update_aid_source_status(ekf, aid, n_axes, time_us, gate):
    """Judge the axes that `set_axis` stored, and filter their innovations for the published status.

    Parameters
    ----------
    aid : AID_SOURCE record with `n_axes` axes set
    time_us : time of the sample (µs)
    gate : innovation gate (standard deviations)

    Any axis beyond the gate, or not finite, rejects the whole observation. `fused` is cleared.
    """
    rejected = False
    has_history = aid.timestamp_sample > 0 and time_us > aid.timestamp_sample
    dt_s = min(max((time_us - aid.timestamp_sample) * 1e-6, 0.001), 1.0)
    alpha = dt_s / (dt_s + FILTER_TIME_CONSTANT_S)
    for i in range(n_axes):
        innovation = aid.innovation[i]
        variance = aid.innovation_variance[i]
        test_ratio = innovation * innovation / (gate * gate * variance)
        if has_history:
            _filter_axis(aid, i, alpha, innovation, test_ratio, gate)
        else:
            aid.test_ratio_filtered[i] = test_ratio
            aid.innovation_filtered[i] = innovation
        aid.test_ratio[i] = test_ratio
        if not test_ratio <= 1.0 or not math.isfinite(innovation) or not math.isfinite(variance):
            rejected = True
    aid.timestamp_sample = time_us
    aid.innovation_rejected = rejected
    aid.fused = False


@kernel
def _filter_axis(aid, i, alpha, innovation, test_ratio, gate):
    """First-order filters of the signed test ratio and of the innovation, bounded while the test fails badly."""
    signed_ratio = test_ratio
    if innovation < 0.0:
        signed_ratio = -test_ratio
    elif innovation == 0.0:
        signed_ratio = 0.0
    if math.isfinite(aid.test_ratio_filtered[i]):
        aid.test_ratio_filtered[i] += alpha * (signed_ratio - aid.test_ratio_filtered[i])
    else:
        aid.test_ratio_filtered[i] = test_ratio
    if math.isfinite(aid.innovation_filtered[i]):
        aid.innovation_filtered[i] += alpha * (innovation - aid.innovation_filtered[i])
    else:
        aid.innovation_filtered[i] = innovation
    if test_ratio > TEST_RATIO_LIMIT:
        innovation_limit = NORMALISED_INNOVATION_LIMIT * gate * math.sqrt(aid.innovation_variance[i])
        aid.test_ratio_filtered[i] = min(max(aid.test_ratio_filtered[i], -TEST_RATIO_LIMIT), TEST_RATIO_LIMIT)
        aid.innovation_filtered[i] = min(max(aid.innovation_filtered[i], -innovation_limit), innovation_limit)


@kernel
def _reset_to_zero_innovation(ekf, aid, n_axes):
    """The state was reset to this source: keep the observation, with an innovation of zero."""
    aid.time_last_fuse = ekf.time_delayed_us
    for i in range(n_axes):
        aid.innovation[i] = 0.0
        aid.innovation_filtered[i] = 0.0
        aid.innovation_variance[i] = aid.observation_variance[i]
        aid.test_ratio[i] = 0.0
        aid.test_ratio_filtered[i] = 0.0
    aid.innovation_rejected = False
    aid.fused = True


@kernel
def _begin_time_out(ekf, aid, n_axes):
    """The state was reset to this source, which is told of by its time-out alone."""
    aid.time_last_fuse = ekf.time_delayed_us


reset_aid_source_status_zero_innovation = by_release(
    _reset_to_zero_innovation, "keeps_innovation_at_reset", _begin_time_out
)


@kernel
def _keep_status(ekf, aid, n_axes):
    """v1.16 publishes what a source judged last, though it was stopped then."""


@kernel
def _forget_status(ekf, aid, n_axes):
    """Nothing has been judged; when it was last fused remains."""
    if aid.timestamp_sample == 0:
        return
    aid.timestamp_sample = 0
    for i in range(n_axes):
        aid.observation[i] = 0.0
        aid.observation_variance[i] = 0.0
        aid.innovation[i] = 0.0
        aid.innovation_variance[i] = 0.0
        aid.test_ratio[i] = math.inf
    aid.innovation_rejected = True
    aid.fused = False


forget_aid_source_status = by_release(_keep_status, "forgets_stopped_sources", _forget_status)
"""A source is stopped; to be called only if it was fused."""
