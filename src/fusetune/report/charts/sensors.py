"""Sensors: Allan deviation, spectra, samples with their spread, of a flight and of a device over several."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from fusetune.analyze.sensor_noise.allan import AllanCurve
from fusetune.analyze.sensor_noise.allan_fit import AllanFigures, freedom_of_mixture, interval
from fusetune.analyze.sensor_noise.allan_model import FLAT
from fusetune.analyze.sensor_noise.distribution import HISTOGRAM_EDGES, OUTLIER, QUANTILES, Distribution
from fusetune.analyze.sensor_noise.pooled import PooledSensor
from fusetune.analyze.sensor_noise.sensor_character import SensorCharacter
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise
from fusetune.analyze.sensor_noise.sensor_series import Sensor, SensorName
from fusetune.analyze.sensor_noise.spectrum import LOWEST_TONE_HZ
from fusetune.report.charts.blocks import chart_block
from fusetune.report.charts.svg.axes import (
    HEAD,
    LABEL_ROOM,
    NARROW,
    TICK_ROOM,
    Panel,
    head,
    minor_rules,
    x_axis,
    y_axis,
    y_room,
)
from fusetune.report.charts.svg.elements import (
    area,
    boxed,
    crosses,
    dots,
    group,
    hinted,
    line,
    path,
    path_steps,
    rectangle,
    svg,
    text,
)
from fusetune.report.charts.svg.legend import Entry, legend, line_symbol, marker_symbol, patch_symbol
from fusetune.report.charts.svg.rows import rows_of
from fusetune.report.charts.svg.scales import Linear, Log, figure, signed_figure
from fusetune.report.counted import count_words
from fusetune.report.sensor_shapes import (
    allan_words,
    beyond_words,
    envelope_rows,
    interval_seconds,
    normal_quantiles,
    outliers,
    standardised_deviations,
    tone_words,
    vibration_title,
)

Array = npt.NDArray[np.float64]

REST, FLIGHT = "tone-1", "tone-4"
"""Classes of what is measured at rest and in flight."""

_LINES = {REST: "dashed", FLIGHT: "thin"}
_AXES = ("tone-5", "tone-0", "tone-1")
_HEIGHT = 170.0
_TOP = HEAD + 20.0
_WORDS = 15.0
_MOST_POINTS = 560
_SPECTRUM_PARTS = 280
_QUANTILE_POINTS = 100
_MOST_TONES = 4
_BOX_ROW = 26.0
_AT = {share: QUANTILES.index(share) for share in QUANTILES}
_SMALLEST_DENSITY = 2e-5


def allan_chart(noise: SensorNoise) -> str:
    """Allan deviation of each sensor of a flight that stood still; empty where none did."""
    return _allan([(one.sensor, one.curve, one.figures) for one in noise.sensors.values()])


def pooled_allan_chart(pooled: Sequence[PooledSensor]) -> str:
    """Of several flights of one vehicle."""
    return _allan([(one.sensor, one.curve, one.figures) for one in pooled if one.curve and one.figures])


def _allan(found: Sequence[tuple[Sensor, AllanCurve, AllanFigures]]) -> str:
    charts: list[str] = []
    for sensor, curve, figures in found:
        if len(curve.factors):
            charts.append(_allan_panel(sensor, curve, figures, with_legend=not charts))
    return chart_block("Allan deviation, from times of standing still", charts)


def _log_panel(x: Sequence[float], y: Sequence[float], top: float = _TOP) -> Panel:
    """Logarithmic axes that hold all values, with some room beside."""
    (x1, x2), (y1, y2) = ((min(one), max(one)) for one in (x, y))
    down = Log(y1 / 1.25, y2 * 1.25, top + _HEIGHT, top)
    return Panel(Log(x1 / 1.08, x2 * 1.08, y_room(down), NARROW - 10.0), down)


def _allan_panel(sensor: Sensor, curve: AllanCurve, figures: AllanFigures, *, with_legend: bool) -> str:
    tau = curve.tau_s
    low, high = interval(curve.deviation, freedom_of_mixture(curve, figures))
    shown = np.concatenate([low, high, curve.deviation])
    shown = shown[np.isfinite(shown) & (shown > 0.0)]
    if not shown.size:
        return ""
    panel = _log_panel(tau.tolist(), shown.tolist())
    assert isinstance(panel.x, Log)
    parts = [head(f"{sensor.label}, longest {curve.longest_s:.0f} s"), minor_rules(panel, panel.x)]
    parts += [y_axis(panel, f"[{sensor.unit}]"), x_axis(panel, "averaging time τ [s]")]
    band = area(panel.x(tau), panel.y(low), panel.y(high), "band")
    measured = path(panel.x(tau), panel.y(curve.deviation), "thin")
    parts.append(group("tone-5", band, measured, dots(panel.x(tau), panel.y(curve.deviation), 2.4, "mark")))
    if figures.noise_density.value is not None:
        fitted = np.geomspace(figures.from_s, tau[-1], 60)
        parts.append(group("tone-0", path(panel.x(fitted), panel.y(figures.deviation(fitted)), "line")))
    if figures.bias_instability.value is not None:
        flat = figures.bias_instability.value * math.sqrt(FLAT)
        if panel.y.holds(flat):
            parts.append(line(panel.left, panel.y.at(flat), panel.right, panel.y.at(flat), "now"))
    words = allan_words(sensor, figures)
    y = panel.bottom + TICK_ROOM + LABEL_ROOM
    parts += [text(0.0, y + _WORDS * (row + 1) - 3.0, one, "note") for row, one in enumerate(words)]
    entries = [
        Entry(marker_symbol("tone-5", "circle", through="thin"), "measured"),
        Entry(patch_symbol("tone-5"), "95 % interval"),
        Entry(line_symbol("tone-0"), "fitted"),
        Entry(line_symbol("ink", "now"), "bias instability"),
    ]
    drawn, height = legend(entries if with_legend else (), y + _WORDS * len(words) + 4.0)
    bottom = y + _WORDS * len(words) + 4.0 + height
    return svg("allan", f"Allan deviation of the {sensor.label}", "; ".join(words), NARROW, bottom, [*parts, drawn], "")


def spectra_chart(noise: SensorNoise) -> str:
    """Spectra of gyro, accelerometer and magnetometer of a flight, with the tones that stand out; empty where there are
    too few samples in a row."""
    charts: list[str] = []
    for one in noise.sensors.values():
        if one.rest_spectrum or one.flight_spectrum:
            charts.append(_spectrum(one, with_legend=not charts))
    return chart_block("Spectra, axes together; grey: the vehicle's motion", charts)


def _spectrum(character: SensorCharacter, *, with_legend: bool) -> str:
    curves = []
    for found, kind in ((character.rest_spectrum, REST), (character.flight_spectrum, FLIGHT)):
        if found is not None:
            level = np.sqrt(found.total)
            known = (found.frequency_hz > 0.0) & (level > 0.0)
            curves.append((kind, *_binned(found.frequency_hz[known], level[known])))
    curves = [one for one in curves if one[1].size]
    if not curves:
        return ""
    x, y = np.concatenate([one[1] for one in curves]), np.concatenate([one[2] for one in curves])
    panel = _log_panel(x.tolist(), [*y.tolist(), 2.0 * float(y.max())])
    assert isinstance(panel.x, Log)
    parts = [head(vibration_title(character))]
    vibration, flight = character.vibration, character.flight_spectrum
    if vibration is not None and flight is not None:
        moved = min(LOWEST_TONE_HZ, panel.x.high)
        if moved > panel.x.low:
            parts.append(rectangle(panel.left, panel.top, panel.x.at(moved), panel.bottom, "ground"))
    parts += [minor_rules(panel, panel.x), y_axis(panel, f"[{character.sensor.unit}/√Hz]")]
    parts.append(x_axis(panel, "frequency [Hz]"))
    parts += [group(kind, path(panel.x(a), panel.y(b), _LINES[kind])) for kind, a, b in curves]
    said = []
    if vibration is not None and flight is not None:
        level = np.sqrt(flight.total)
        for one in vibration.tones.listed[:_MOST_TONES]:
            place = int(np.argmin(np.abs(flight.frequency_hz - one.tone.frequency_hz)))
            above = float(level[max(place - 3, 0) : place + 4].max())
            words = tone_words(one)
            said.append(" ".join(words))
            if panel.x.holds(one.tone.frequency_hz) and panel.y.holds(above):
                parts.append(_tone(panel, one.tone.frequency_hz, above, words))
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    entries = [
        Entry(line_symbol(REST, _LINES[REST]), "at rest"),
        Entry(line_symbol(FLIGHT, _LINES[FLIGHT]), "in flight"),
    ]
    drawn, height = legend(entries if with_legend else (), below)
    title = f"Spectrum of the {character.sensor.label}"
    return svg("spectrum", title, "; ".join(said) or "no tones", NARROW, below + height, [*parts, drawn], "")


def _binned(x: Array, y: Array) -> tuple[Array, Array]:
    """A spectrum as a chart can show it: in each part of the logarithmic axis the largest value, so no tone is lost."""
    if x.size <= _SPECTRUM_PARTS:
        return x, y
    part = np.digitize(np.log(x), np.linspace(math.log(x[0]), math.log(x[-1]), _SPECTRUM_PARTS))
    starts = np.flatnonzero(np.diff(part, prepend=-1))
    rows = np.array(
        [start + int(np.argmax(y[start:stop])) for start, stop in zip(starts, [*starts[1:], x.size], strict=True)]
    )
    return x[rows], y[rows]


def _tone(panel: Panel, frequency_hz: float, level: float, words: Sequence[str]) -> str:
    x, y = panel.x.at(frequency_hz), panel.y.at(level)
    last = max(y - 6.0, panel.top + 12.0 * len(words) - 2.0)
    lines = [text(x, last - 12.0 * (len(words) - 1 - row), one, "over", "middle") for row, one in enumerate(words)]
    return hinted(" ".join(words), *lines)


def sensor_chart(noise: SensorNoise, name: SensorName) -> str:
    """One sensor of a flight: samples of each axis with outliers marked, boxes, histogram, normal quantiles.

    Parameters
    ----------
    name : a sensor that the flight has
    """
    character = noise.sensors[name]
    wild = outliers(noise, character)
    charts = [_sequence(noise, character, wild[:, row], row) for row in range(len(character.sensor.axes))]
    parts = {"at rest": character.at_rest, "in flight": character.in_flight}
    rows = [
        (f"{axis}, {label}", kind, np.array(one.quantiles))
        for place, axis in enumerate(character.sensor.axes)
        for label, kind, found in (("at rest", REST, parts["at rest"]), ("in flight", FLIGHT, parts["in flight"]))
        for one in found[place : place + 1]
    ]
    charts.append(_boxes(rows, "Spread from sample to sample: half, 96 %, all", character.sensor.unit))
    charts.append(_histogram({label: _counts(one) for label, one in parts.items() if one}))
    charts.append(_normality(noise, character))
    title = f"{character.sensor.label}: {character.series.topic}, {character.series.rate_hz:.0f} Hz"
    return chart_block(title, [one for one in charts if one])


def _sequence(noise: SensorNoise, character: SensorCharacter, wild: npt.NDArray[np.bool_], row: int) -> str:
    """Values over time; outliers, which may be single samples, are drawn whatever is thinned."""
    series = character.series
    time, values = (series.time - noise.start_timestamp) * 1e-6, series.values[:, row]
    known = np.isfinite(values)
    if not known.any():
        return ""
    low, high = float(values[known].min()), float(values[known].max())
    margin = 0.06 * (high - low) or max(abs(high), 1.0) * 0.05
    y = Linear(low - margin, high + margin, _TOP + 0.7 * _HEIGHT, _TOP)
    panel = Panel(
        Linear(float(time[0]), max(float(time[-1]), float(time[0]) + 1e-3), y_room(y, signed_figure), NARROW - 10.0), y
    )
    label = character.sensor.axes[row]
    parts = [head(f"{character.sensor.label} {label}".rstrip())]
    for kind, intervals in ((REST, noise.still), (FLIGHT, noise.airborne)):
        for one in intervals:
            ends = np.clip(panel.x(interval_seconds(noise, one)), panel.left, panel.right).tolist()
            parts.append(group(kind, rectangle(ends[0], panel.top, ends[1], panel.bottom, "band")))
    parts += [
        y_axis(panel, f"[{character.sensor.unit}]", words=signed_figure),
        x_axis(panel, "time since the log began [s]"),
    ]
    shown = envelope_rows(values, _MOST_POINTS)
    parts.append(group(_AXES[row % len(_AXES)], path(panel.x(time[shown]), panel.y(values[shown]), "thin")))
    count = count_words(int(wild.sum()), "outlier")
    if wild.any():
        parts.append(group("bad", hinted(count, crosses(panel.x(time[wild]), panel.y(values[wild]), 3.0, "line"))))
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    entries = [Entry(patch_symbol(REST), "at rest"), Entry(patch_symbol(FLIGHT), "in flight")]
    if wild.any():
        entries.append(Entry(lambda x, y: group("bad", crosses([x], [y], 3.0, "line")), count))
    drawn, height = legend(entries, below)
    said = f"{figure(low)} to {figure(high)} {character.sensor.unit}, {count}"
    return svg("samples", f"{character.sensor.label} {label}", said, NARROW, below + height, [*parts, drawn], "")


def _counts(parts: Sequence[Distribution]) -> Array:
    return np.sum([one.histogram for one in parts], axis=0)


def _boxes(rows: Sequence[tuple[str, str, Array]], title: str, unit: str) -> str:
    """Boxes of half of the samples, whiskers of 96 %, and dots at the smallest and the largest; empty without any."""
    if not rows:
        return ""
    reach = max(max(abs(float(one[0])), abs(float(one[-1]))) for _, _, one in rows) * 1.05 or 1.0
    named = rows_of([name for name, _, _ in rows], HEAD + 4.0, _BOX_ROW * 0.72)
    panel = Panel(Linear(-reach, reach, named.room, NARROW - 10.0), Linear(len(rows), 0.0, named.bottom, named.top))
    parts = [head(title), named.labels(), x_axis(panel, f"[{unit}]", words=signed_figure)]
    said = []
    for place, (name, kind, one) in enumerate(rows):
        y = named.y(place)
        low, q1, median, q3, high = (panel.x.at(float(one[_AT[share]])) for share in (0.02, 0.25, 0.5, 0.75, 0.98))
        words = f"{name}: half {figure(float(one[_AT[0.25]]), 3)} to {figure(float(one[_AT[0.75]]), 3)} {unit}"
        said.append(words)
        ends = dots(panel.x(one[[0, -1]]), y, 1.8, "mark")
        parts.append(group(kind, hinted(words, boxed(low, q1, median, q3, high, y), ends)))
    height = panel.bottom + TICK_ROOM + LABEL_ROOM
    return svg("spread", title, "; ".join(said), NARROW, height, parts, "")


def _histogram(counts: dict[str, Array]) -> str:
    """Share of the samples by standard deviations, all axes together, beside the normal distribution's."""
    if not counts:
        return ""
    width = float(HISTOGRAM_EDGES[1] - HISTOGRAM_EDGES[0])
    low, high = float(HISTOGRAM_EDGES[0]), float(HISTOGRAM_EDGES[-1])
    y = Log(_SMALLEST_DENSITY, 1.0, _TOP + 0.7 * _HEIGHT, _TOP)
    panel = Panel(Linear(low, high, y_room(y), NARROW - 10.0), y)
    parts = [head("Histogram, all axes together"), y_axis(panel, "density")]
    parts.append(x_axis(panel, "robust standard deviations", words=signed_figure))
    entries = []
    for label, count in counts.items():
        kind = REST if label == "at rest" else FLIGHT
        density = np.maximum(count / max(count.sum(), 1) / width, _SMALLEST_DENSITY)
        x = np.repeat(panel.x(HISTOGRAM_EDGES), 2)
        down = np.concatenate([[panel.bottom], np.repeat(panel.y(density), 2), [panel.bottom]])
        parts.append(group(kind, hinted(label, f'<path class="box" d="{path_steps(x, down)}Z"/>')))
        entries.append(Entry(patch_symbol(kind, "box"), label))
    centre = np.linspace(low, high, 80)
    normal = norm.pdf(centre)
    shown = normal >= _SMALLEST_DENSITY
    parts.append(group("ink", path(panel.x(centre[shown]), panel.y(normal[shown]), "dashed")))
    entries.append(Entry(line_symbol("ink", "dashed"), "normal"))
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    drawn, height = legend(entries, below)
    return svg("histogram", "Histogram", ", ".join(counts), NARROW, below + height, [*parts, drawn], "")


def _normality(noise: SensorNoise, character: SensorCharacter) -> str:
    """Quantiles against those of a normal distribution, and how many times more samples lie beyond three sigma."""
    reach = 2.0 * OUTLIER - 2.0
    y = Linear(-reach, reach, _TOP + 0.7 * _HEIGHT, _TOP)
    panel = Panel(Linear(-4.2, 4.2, y_room(y, signed_figure), NARROW - 10.0), y)
    parts = [head("Normality"), y_axis(panel, "sample quantile", words=signed_figure)]
    parts.append(x_axis(panel, "normal quantile", words=signed_figure))
    ends = (panel.x.at(-4.0), panel.y.at(-4.0), panel.x.at(4.0), panel.y.at(4.0))
    parts.append(line(*ends, "axis"))
    entries, said = [], []
    for label, intervals, found, kind in (
        ("at rest", noise.still, character.at_rest, REST),
        ("in flight", noise.airborne, character.in_flight, FLIGHT),
    ):
        if found:
            normal, sample = normal_quantiles(standardised_deviations(character, intervals), _QUANTILE_POINTS)
            inside = np.abs(sample) <= reach
            parts.append(group(kind, path(panel.x(normal), np.where(inside, panel.y(sample), np.nan), _LINES[kind])))
            said.append(" ".join(beyond_words(label, found)))
            entries.append(Entry(line_symbol(kind, _LINES[kind]), said[-1]))
    if not said:
        return ""
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    drawn, height = legend(entries, below)
    return svg("normality", "Normality", "; ".join(said), NARROW, below + height, [*parts, drawn], "")


def pooled_sensor_chart(pooled: PooledSensor) -> str:
    """One device over several flights: boxes of each flight, and the histogram of all together."""
    rows = [
        (f"{share.flight}, {label}", kind, np.mean([one.quantiles for one in part], axis=0))
        for share in pooled.flights
        for label, kind, part in (("at rest", REST, share.at_rest), ("in flight", FLIGHT, share.in_flight))
        if part
    ]
    counts = {"at rest": pooled.histogram(at_rest=True), "in flight": pooled.histogram(at_rest=False)}
    charts = [
        _boxes(rows, "Spread from sample to sample, mean of the axes", pooled.sensor.unit),
        _histogram({label: one for label, one in counts.items() if one.sum()}),
    ]
    title = f"{pooled.sensor.label}, device {pooled.device_id or 'unknown'}"
    return chart_block(title, [one for one in charts if one])
