"""A magnetometer against the earth's field at the place and the attitude that gyros, level and GNSS tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.diagnosis.field_fits import FieldFit, FieldReadings, field_fits
from fusetune.analyze.diagnosis.gnss_signs import has_fix
from fusetune.analyze.diagnosis.motion import Motion
from fusetune.analyze.flight.intervals import Interval, inside, stretches
from fusetune.ekf2.feed.message_samples import mag_samples
from fusetune.ekf2.numerics.world_magnetic_model import field_at
from fusetune.px4.flight import Flight, TopicTable

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

MEAN_OVER_US = 500_000
MARGIN_US = 2_000_000
"""So long after take-off and before landing the ground's iron still shows."""
CERTAIN_HEADING = np.radians(4.0)
FEWEST = 12


@dataclass(frozen=True)
class MagnetometerSigns:
    """Readings in the air against the field of the place.

    Attributes
    ----------
    strength : median of the readings' size over that of the field
    field_gauss, level_gauss : strength of the field at the place, and of its level part
    by_gnss : whether the heading is that of GNSS; else it is the magnetometer's own
    fits : causes held against the readings, by name (`field_fits`)
    noise : of an averaged reading, per axis, Gauss
    reading_noise : of a reading
    motors_off : (3,) field of the body on the ground before the motors turn, Gauss; NaN where none was logged
    in_air : (3,) the same in the air
    disturbed : when a field of the place came and went, µs
    disturbance : how strong it was, Gauss, median
    undisturbed : RMS of what is left of the readings outside of it, Gauss
    compass_off : how far the readings alone would turn the heading in the air, 90 % of the time less, rad
    """

    strength: float
    field_gauss: float
    level_gauss: float
    by_gnss: bool
    fits: dict[str, FieldFit]
    noise: float
    reading_noise: float
    motors_off: Array
    in_air: Array
    disturbed: Interval | None
    disturbance: float
    undisturbed: float
    compass_off: float


def earth_field(flight: Flight) -> Array | None:
    """Field at the place of the first fix, NED, Gauss; None without a fix."""
    table = flight.topic("vehicle_gps_position")
    if table is None or "latitude_deg" not in table or not np.any(has_fix(table)):
        return None
    first = int(np.argmax(has_fix(table)))
    declination, inclination, strength = field_at(
        float(table["latitude_deg"][first]), float(table["longitude_deg"][first])
    )
    level = strength * np.cos(inclination)
    return np.array([level * np.cos(declination), level * np.sin(declination), strength * np.sin(inclination)])


def magnetometer_signs(
    flight: Flight, motion: Motion, airborne: tuple[Interval, ...], heading: tuple[float, float] | None
) -> MagnetometerSigns | None:
    """Look at the readings; None without enough of them, or where the place is not known.

    Parameters
    ----------
    heading : of the gyros' frame, and its standard error, rad
    """
    table, earth = flight.topic("vehicle_magnetometer"), earth_field(flight)
    if table is None or earth is None:
        return None
    flying = tuple((a + MARGIN_US, b - MARGIN_US) for a, b in airborne if b - a > 2 * MARGIN_US)
    found = _readings(table, motion, flying)
    if found is None or found[0].time_s.size < FEWEST:
        return None
    readings, reading_noise, together = found
    noise = reading_noise / np.sqrt(together)
    known = heading[0] if heading is not None and heading[1] < CERTAIN_HEADING else None
    fits = field_fits(readings, earth, known)
    if known is not None and _is_heading_wrong(fits, known):
        known = None
        fits = field_fits(readings, earth, known)
    strength = float(np.linalg.norm(earth))
    at = known if known is not None else fits["body_field"].heading
    still = ((airborne[0][0] - 60_000_000, airborne[0][0] - 500_000),)
    grounded = _readings(table, motion, still)
    off = np.full(3, np.nan)
    if grounded is not None and grounded[0].time_s.size >= 4 and known is not None:
        before = grounded[0]
        off = np.median(before.measured - before.expected(earth, at), axis=0)
    left = readings.measured - readings.expected(earth, at)
    body = np.median(left, axis=0)
    span, size, calm = _disturbed(readings, left - body, noise)
    return MagnetometerSigns(
        strength=float(np.median(np.linalg.norm(readings.measured, axis=1))) / strength,
        field_gauss=strength,
        level_gauss=float(np.hypot(earth[0], earth[1])),
        by_gnss=known is not None,
        fits=fits,
        noise=noise,
        reading_noise=reading_noise,
        motors_off=off,
        in_air=body,
        disturbed=span,
        disturbance=size,
        undisturbed=calm,
        compass_off=_compass_off(readings, earth, at),
    )


def _is_heading_wrong(fits: dict[str, FieldFit], heading: float) -> bool:
    """Whether the heading of GNSS is off and not the magnetometer, whose readings fit under another one alone.

    A field of the body turns with the vehicle and does not; a mounting does, but by more than `MOST_OFF`. Legs along
    one line tell GNSS the heading worse than its error says.
    """
    own = fits["own_heading"]
    off = abs(float(np.angle(np.exp(1j * (own.heading - heading)))))
    return own.left < 0.5 * fits["body_field"].left and off < MOST_OFF


MOST_OFF = np.radians(35.0)


def _compass_off(readings: FieldReadings, earth: Array, heading: float) -> float:
    """Angle from the level part of the readings to that of the field, 90 % of its sizes."""
    level = np.einsum("nij,nj->ni", readings.rotation, readings.measured)[:, :2]
    seen = np.arctan2(level[:, 1], level[:, 0]) + heading
    off = seen - np.arctan2(earth[1], earth[0])
    return float(np.percentile(np.abs(np.angle(np.exp(1j * off))), 90.0))


def _readings(
    table: TopicTable, motion: Motion, intervals: tuple[Interval, ...]
) -> tuple[FieldReadings, float, float] | None:
    """Means over half a second, the noise of a reading per axis, and how many readings are in a mean."""
    samples = mag_samples(table)
    time, field = samples["time_us"].astype(np.int64), samples["mag"]
    rows = inside(time, intervals) & (time > motion.time[0]) & (time < motion.time[-1]) & np.isfinite(field).all(axis=1)
    if np.count_nonzero(rows) < 4:
        return None
    time, field = time[rows], field[rows]
    _, group, count = np.unique((time - time[0]) // MEAN_OVER_US, return_inverse=True, return_counts=True)
    since = np.bincount(group, (time - time[0]).astype(np.float64)) / count
    means = np.column_stack([np.bincount(group, axis) / count for axis in field.T])
    at = time[0] + np.rint(since).astype(np.int64)
    rotation = motion.at(at, motion.rotation)
    # the mean of two rotations is none
    left, _, right = np.linalg.svd(rotation)
    within = np.diff(field, axis=0)
    noise = float(np.median(np.abs(within - np.median(within, axis=0)))) / 0.6745 / np.sqrt(2.0)
    readings = FieldReadings(at * 1e-6, means, left @ right, motion.at(at, motion.thrust))
    return readings, noise, max(float(np.median(count)), 1.0)


DISTURBED_FROM, SIGMAS = 0.12, 6.0
"""A passing field matters from this share of the earth's on, and is more than this times the readings' noise."""
MOST_OF_FLIGHT = 0.7
FEWEST_DISTURBED = 5
"""Means of half a second: what passes within three is a turn that the gyros tell badly."""


def _disturbed(readings: FieldReadings, left: Array, noise: float) -> tuple[Interval | None, float, float]:
    """When the rest of the readings was large together, how large, and how large elsewhere."""
    in_place = np.einsum("nij,nj->ni", readings.rotation, left)
    size = np.linalg.norm(in_place - np.median(in_place, axis=0), axis=1)
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(size, 1, mode="edge"), 3), axis=1)
    calm_size = float(np.percentile(smooth, 30.0))
    least = max(
        3.0 * calm_size, SIGMAS * noise, DISTURBED_FROM * float(np.median(np.linalg.norm(readings.measured, axis=1)))
    )
    on = smooth > least
    if not 3 <= np.count_nonzero(on) <= MOST_OF_FLIGHT * on.size:
        return None, 0.0, float(np.sqrt(np.mean(np.square(left))))
    # what lies seconds apart is one disturbance
    first, end = max(stretches(on), key=lambda one: one[1] - one[0])
    last = end - 1
    if last - first < FEWEST_DISTURBED:
        return None, 0.0, float(np.sqrt(np.mean(np.square(left))))
    margin = np.zeros(on.size, bool)
    margin[max(first - 3, 0) : last + 4] = True
    calm = left[~margin]
    span = (int(readings.time_s[first] * 1e6), int(readings.time_s[last] * 1e6) + MEAN_OVER_US)
    return (
        span,
        float(np.median(size[first : last + 1])),
        float(np.sqrt(np.mean(np.square(calm - np.median(calm, axis=0))))) if calm.size else 0.0,
    )
