"""What these flights cannot tell because of how they were flown, and what kind of flight would.

Limits come from the worlds of docs/next_flights.md, or from the formula that stands beside them; those of motions that
missions are made of stand with these (`design/missions/purpose.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from fusetune.analyze.delays.wrong_delays import FEWEST_FLIGHTS, JoinedDelay
from fusetune.analyze.effects.joined_effects import JoinedEffects
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.missing_motion_kinds import DELAYS, LEVER_ARMS, MINUTES, NOISES, THINNED
from fusetune.design.missions.purpose import BRISK_M_S2, TURNING_DEG_S
from fusetune.set_names import EFFECT_SETS

SURE_DELAY_MS = 15.0
"""A delay whose interval reaches no further needs no other flight; as much off matters (`delays.matters_ms`)."""

STILL_SHARE = 0.7
"""A flight of which more is spent hovering is one of hovering: noises found in it are those of hovering."""

NOISE_MINUTES = 3.0
"""Errors of GNSS velocity that wander over 2 s are some 30 independent ones a minute; a standard deviation of N is
known to 1/√(2N), 7 % after three minutes."""

GNSS_HZ = 4.0
"""Receivers give 5 to 10 positions a second; where fewer are scored, the log was thinned."""

SURE_ARM_M = 0.05
"""A lever arm whose interval reaches no further needs no other flight."""
_AXES = "XYZ"


@dataclass(frozen=True)
class MissingMotion:
    """Something that the flights so far cannot tell.

    Attributes
    ----------
    kind : `DELAYS`, `NOISES`, `LEVER_ARMS`, `MINUTES` or `THINNED`
    cannot : what cannot be told and why, a sentence
    fly : what would tell it, to follow "with" or to stand alone
    """

    kind: str
    cannot: str
    fly: str


def missing_motion(
    flights: Sequence[AnalyzedFlight],
    present: str,
    delays: Sequence[JoinedDelay] = (),
    effects: JoinedEffects | None = None,
) -> tuple[MissingMotion, ...]:
    """What is missing, the most useful first; nothing where the flights do not say how they moved.

    Parameters
    ----------
    flights : those that decide
    present : the set that flies now
    delays, effects : as estimated over all flights: what is sure needs no other flight
    """
    summaries = [one.summary for one in flights if one.evidence is not None and one.summary.get("excitation")]
    if not summaries:
        return ()
    moved: list[Mapping[str, float]] = [one["excitation"] for one in summaries]
    hovering = all(one["hover_share"] > STILL_SHARE for one in moved)
    found = []
    brisk = sum(one["horizontal_acceleration_m_s2"] >= BRISK_M_S2 for one in moved)
    sure = any(one.upper_ms - one.lower_ms <= 2.0 * SURE_DELAY_MS for one in delays if one.sensor == "gnss")
    if brisk < FEWEST_FLIGHTS and not sure:
        found.append(_delays(hovering, brisk, len(moved)))
    elif hovering:
        found.append(MissingMotion(NOISES, "All flights hover: noises found here are those of hovering", _LEGS))
    turning = sum(max(one["roll_pitch_rate_deg_s"], one["yaw_rate_deg_s"]) >= TURNING_DEG_S for one in moved)
    if turning < FEWEST_FLIGHTS and not _knows_antenna(effects):
        few = "no flight turns" if not turning else "only one flight turns"
        cannot = f"Lever arms (EKF2_IMU_POS_*, EKF2_GPS_POS_*) cannot be told: {few} fast enough"
        found.append(MissingMotion(LEVER_ARMS, cannot, "fast turns in yaw, and in pitch and roll, both ways"))
    rate = _gnss_hz(summaries, present)
    if rate is not None and rate < GNSS_HZ:
        cannot = f"GNSS stands in these logs {rate:.1f} times a second, which blurs its delay and its noise"
        found.append(MissingMotion(THINNED, cannot, LOG_PROFILE))
    minutes = sum(one["seconds"] for one in moved) / 60.0
    if minutes < NOISE_MINUTES:
        cannot = f"The noise of GNSS cannot be told from {minutes:.1f} minutes"
        found.append(MissingMotion(MINUTES, cannot, f"at least {NOISE_MINUTES:g} minutes in all"))
    return tuple(found)


LOG_PROFILE = "log with the bit “estimator replay” of SDLOG_PROFILE set, from boot (SDLOG_MODE 1)"
_LEGS = "three hard accelerate–stop legs of 5 s each way"


def _knows_antenna(effects: JoinedEffects | None) -> bool:
    """Whether the flights tell each axis of the GNSS antenna's place."""
    told = effects.effects.get(EFFECT_SETS["antenna_mended"], {}) if effects is not None else {}
    return len(told) == len(_AXES) and all(one.upper - one.lower <= 2.0 * SURE_ARM_M for one in told.values())


def _delays(hovering: bool, brisk: int, flights: int) -> MissingMotion:
    if hovering:
        cannot = "Hover only: delays cannot be told, and noises found here are those of hovering"
    elif brisk:
        cannot = f"Only one of {flights} flights accelerates hard enough to tell the delay of GNSS"
    else:
        cannot = "No flight accelerates hard enough to tell the delay of GNSS"
    return MissingMotion(DELAYS, cannot, _LEGS)


def _gnss_hz(summaries: Sequence[Mapping[str, Any]], present: str) -> float | None:
    """Scored GNSS velocities a second, the median of the flights; None where there are none."""
    rates = []
    for one in summaries:
        samples = one["sets"].get(present, {}).get("evidence", {}).get("samples", {}).get("gnss_vel")
        if samples and one["scored_s"] > 0.0:
            rates.append(samples["mask"] / one["scored_s"])
    return median(rates) if rates else None
