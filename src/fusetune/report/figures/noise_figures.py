"""Files of what is drawn of the sensors: of a flight, and of all flights of a vehicle."""

from __future__ import annotations

from pathlib import Path

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
    folder = Path(output_folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    with figure_style():
        for name in noise.sensors:
            files.append(folder / f"sensor_{name}.png")
            save_png(draw_sensor(noise, name), files[-1])
        for name, draw in (("allan", draw_allan), ("spectra", draw_spectra)):
            files.append(folder / f"{name}.svg")
            save_svg(draw(noise), files[-1])
    return tuple(files)


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
    folder = Path(output_folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    with figure_style():
        for one in pooled:
            files.append(folder / f"pooled_{one.sensor.name}_{one.device_id}.svg")
            save_svg(draw_pooled_sensor(one), files[-1])
        files.append(folder / "pooled_allan.svg")
        save_svg(draw_pooled_allan(pooled), files[-1])
    return tuple(files)
