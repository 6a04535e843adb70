"""What releases before v1.16 tell of a sample that they do not fuse: that there was one."""

import math

from fusetune.ekf2.compiled.kernel import kernel


@kernel
def forget_judgement(aid, n_axes):
    """Forget what was found of the last sample, but not when one was fused."""
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
