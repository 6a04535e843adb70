"""Execute: a simulated vehicle flies a mission and leaves a real ULog.

The truth is built from continuous kinematics on the rotating WGS-84 earth and the sensors are modelled on that truth.
Nothing here shares physics with the estimator; only `onboard_estimator` runs it, as the vehicle itself would.
"""

from fusetune.execute.simulation import simulate

__all__ = ["simulate"]
