"""Files of what is drawn of the sensors: of a flight, and of all flights of a vehicle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from fusetune.analyze.sensor_noise.pooled import PooledSensor
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise
from fusetune.report.figures.allan_figure import draw_allan, draw_pooled_allan
from fusetune.report.figures.drawing import figure_style, save_png, save_svg
from fusetune.report.figures.sensor_figures import draw_pooled_sensor, draw_sensor
from fusetune.report.figures.spectrum_figure import draw_spectra
from fusetune.storage.files import AnyPath


def plot_sensor_noise(noise: SensorNoise, output_folder: AnyPath) -> tuple[Path, ...]:
    """Draw the sensors of a flight.

    Parameters
    ----------
    noise : of the flight, with its samples
    output_folder : is made where it does not exist; takes `sensor_<name>.png` of each sensor, `allan.svg` and
        `spectra.svg`

    Returns
    -------
    The files.
    """
    drawings: list[tuple[str, Callable[[], Figure]]] = [
        (f"sensor_{name}.png", partial(draw_sensor, noise, name)) for name in noise.sensors
    ]
    drawings += [("allan.svg", partial(draw_allan, noise)), ("spectra.svg", partial(draw_spectra, noise))]
    return _written(output_folder, drawings)


def plot_pooled_sensors(pooled: tuple[PooledSensor, ...], output_folder: AnyPath) -> tuple[Path, ...]:
    """Draw the sensors of a vehicle over its flights.

    Parameters
    ----------
    pooled : each device by itself
    output_folder : is made where it does not exist; takes `pooled_<sensor>_<device>.svg` and `pooled_allan.svg`

    Returns
    -------
    The files.
    """
    drawings: list[tuple[str, Callable[[], Figure]]] = [
        (f"pooled_{one.sensor.name}_{one.device_id}.svg", partial(draw_pooled_sensor, one)) for one in pooled
    ]
    return _written(output_folder, [*drawings, ("pooled_allan.svg", partial(draw_pooled_allan, pooled))])


def _written(output_folder: AnyPath, drawings: Sequence[tuple[str, Callable[[], Figure]]]) -> tuple[Path, ...]:
    """Files of what is drawn, one after the other: figures take more memory than their files."""
    folder = Path(output_folder)
    folder.mkdir(parents=True, exist_ok=True)
    with figure_style():
        for name, draw in drawings:
            save = save_svg if name.endswith(".svg") else save_png
            save(draw(), folder / name)
    return tuple(folder / name for name, _ in drawings)
