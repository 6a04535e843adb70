"""Rotor wash near the ground raises the static pressure, so the barometer reads low there."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import get_hagl, is_terrain_estimate_valid
from fusetune.ekf2.filter.common.timing import is_timed_out

GND_EFFECT_TIMEOUT = 10_000_000


@kernel
def update_ground_effect(ekf, params):
    """Keep `cs.gnd_effect` by the height above a known terrain or, where it is unknown, for at most 10 s."""
    if not ekf.cs.in_air or ekf.cs.fixed_wing:
        ekf.cs.gnd_effect = False
    elif is_terrain_estimate_valid(ekf):
        ekf.cs.gnd_effect = get_hagl(ekf) < params.EKF2_GND_MAX_HGT
    elif ekf.cs.gnd_effect and is_timed_out(ekf, ekf.time_last_gnd_effect_on, GND_EFFECT_TIMEOUT):
        ekf.cs.gnd_effect = False


@kernel
def apply_ground_effect_deadzone(innovation, deadzone):
    """Innovation (m) with the part explained by ground effect taken off: none for observations above the estimate."""
    if innovation >= 0.0:
        return innovation
    if innovation <= -deadzone:
        return innovation + deadzone
    return 0.0
