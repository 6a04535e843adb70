"""A mission as a map and a profile: where it leads, how fast, how high, and when."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from fusetune.design.missions.flown_path import flown_path
from fusetune.design.missions.limits import Limits
from fusetune.design.missions.mission import Mission
from fusetune.design.missions.outlook import PlannedMotion, motion_of
from fusetune.design.missions.route import RouteLeg, route_of
from fusetune.px4.local_map import LocalMap
from fusetune.report.figures.drawing import CHOSEN_COLOUR, PRESENT_COLOUR, figure_style, new_figure, save_png, save_svg
from fusetune.storage.files import AnyPath

_SPEEDS = "viridis_r"
_ROUTE, _HEADING, _FENCE, _FORBIDDEN = "#999999", "#CC79A7", "#009E73", "#D55E00"
_ROOM, _DIGIT = 0.028, 0.012
"""Share of the width of the map that a number takes, and of the width of the profile that each of its digits does."""
_SAME_M = 0.5
_LEAST_HEADING = 30.0
"""Degrees that the panel of the heading spans at least."""
_MARGIN = 0.08


def draw_mission(mission: Mission, limits: Limits, path: AnyPath) -> None:
    """Draw a mission into an SVG file, or into a PNG file where its name ends so."""
    with figure_style():
        figure = mission_figure(mission, limits)
        if str(path).casefold().endswith(".png"):
            save_png(figure, path)
        else:
            save_svg(figure, path)


def mission_figure(mission: Mission, limits: Limits) -> Figure:
    """The map on the left; height, speed and heading over time on the right."""
    flown, route = flown_path(mission, limits), route_of(mission)
    motion = motion_of(flown)
    figure = new_figure(10.4, 5.0)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.1), height_ratios=(1.0, 1.0, 0.8))
    _map(figure.add_subplot(grid[:, 0]), mission, motion, route)
    profiles = (
        ("height above home [m]", -motion.position[:, 2], PRESENT_COLOUR),
        ("horizontal speed [m/s]", np.hypot(*motion.velocity[:, :2].T), CHOSEN_COLOUR),
        ("heading [°]", np.degrees(motion.yaw), _HEADING),
    )
    ends_s = [end - flown.takeoff_s for end in flown.leg_ends_s]
    for row, (label, values, colour) in enumerate(profiles):
        axes = figure.add_subplot(grid[row, 1])
        axes.plot(motion.time_s, values, color=colour)
        axes.set(ylabel=label.replace(" [", "\n["), xlim=(0.0, motion.time_s[-1]))
        axes.tick_params(labelbottom=row == len(profiles) - 1)
        for leg, end in zip(route, ends_s, strict=True):
            if leg.waypoint is not None:
                axes.axvline(end, color=_ROUTE, linewidth=0.3, zorder=0)
        if row == 0:
            _times(axes, motion.time_s[-1], ends_s, route)
        if row < len(profiles) - 1:
            axes.set_ylim(bottom=0.0)
    low, high = axes.get_ylim()
    if high - low < _LEAST_HEADING:
        axes.set_ylim(0.5 * (low + high - _LEAST_HEADING), 0.5 * (low + high + _LEAST_HEADING))
    axes.set(xlabel="time in the air [s]")
    figure.suptitle(f"Mission {mission.name}", x=0.01, ha="left", fontsize=11)
    return figure


def _times(axes: Axes, duration_s: float, ends_s: Sequence[float], route: Sequence[RouteLeg]) -> None:
    """Numbers of the waypoints above the profile, as many as have room."""
    free_from = -duration_s
    for leg, end in zip(route, ends_s, strict=True):
        if leg.waypoint is not None and end >= free_from:
            axes.text(
                end, 1.01, f"{leg.waypoint + 1}", fontsize=7, ha="center", va="bottom", color="#666666",
                transform=axes.get_xaxis_transform(),
            )  # fmt: skip
            free_from = end + (0.01 + _DIGIT * len(str(leg.waypoint + 1))) * duration_s


def _map(axes: Axes, mission: Mission, motion: PlannedMotion, route: Sequence[RouteLeg]) -> None:
    corners = np.array([(leg.end[1], leg.end[0]) for leg in route])
    axes.plot(*corners.T, "--", color=_ROUTE, linewidth=0.8, zorder=1, label="straight legs")
    east, north = motion.position[:, 1], motion.position[:, 0]
    places = np.column_stack([east, north])
    speed = np.hypot(motion.velocity[:, 0], motion.velocity[:, 1])
    parts = LineCollection(
        list(np.stack([places[:-1], places[1:]], axis=1)),
        array=0.5 * (speed[1:] + speed[:-1]),
        cmap=_SPEEDS,
        norm=Normalize(0.0, max(float(speed.max()), 1.0)),
        linewidths=2.0,
        capstyle="round",
        zorder=2,
        # some thousand parts, which would be a path each
        rasterized=True,
    )
    axes.add_collection(parts)
    bar = axes.figure.colorbar(parts, ax=axes, location="bottom", shrink=0.8, aspect=40, pad=0.02)
    bar.set_label("horizontal speed of the flown path [m/s]")
    _waypoints(axes, route)
    axes.plot(0.0, 0.0, marker="^", markersize=9, color=PRESENT_COLOUR, linestyle="", zorder=4, label="home")
    _fence(axes, mission)
    _frame(axes, np.concatenate([places, corners]), mission)
    for place, text in _numbers(route, 2.0 * _ROOM * float(np.ptp(axes.get_xlim()))):
        axes.annotate(text, place, xytext=(4, 4), textcoords="offset points", fontsize=7, zorder=5)
    axes.set(xlabel="east of home [m]", ylabel="north of home [m]", aspect="equal")
    axes.legend(
        loc="upper left", bbox_to_anchor=(0.0, 1.09), ncols=6, fontsize=6.5, borderaxespad=0.0,
        columnspacing=0.8, handlelength=1.2, handletextpad=0.4,
    )  # fmt: skip


def _waypoints(axes: Axes, route: Sequence[RouteLeg]) -> None:
    looks = {
        "stop": ("s", [leg for leg in route if leg.waypoint is not None and leg.hold_s > 0.0]),
        "fly over": ("o", [leg for leg in route if _passes(leg, "fly_over")]),
        "fly by": ("D", [leg for leg in route if _passes(leg, "fly_by")]),
    }
    for label, (marker, legs) in looks.items():
        if legs:
            axes.plot(
                [leg.end[1] for leg in legs], [leg.end[0] for leg in legs], marker=marker, markersize=4.5, linestyle="",
                markerfacecolor="white", markeredgecolor=CHOSEN_COLOUR, zorder=3, label=label,
            )  # fmt: skip


def _passes(leg: RouteLeg, turn: str) -> bool:
    return leg.waypoint is not None and leg.hold_s == 0.0 and leg.turn == turn


def _numbers(route: Sequence[RouteLeg], apart_m: float) -> list[tuple[tuple[float, float], str]]:
    """East and north, and the numbers of the waypoints there: those at one place together, none too near another."""
    found: list[tuple[tuple[float, float], list[int]]] = []
    for leg in route:
        if leg.waypoint is None:
            continue
        place, number = (leg.end[1], leg.end[0]), leg.waypoint + 1
        same = [numbers for other, numbers in found if math.dist(other, place) < _SAME_M]
        if same:
            same[0].append(number)
        else:
            found.append((place, [number]))
    shown: list[tuple[tuple[float, float], str]] = []
    for place, numbers in found:
        if all(math.dist(place, other) > apart_m for other, _ in shown):
            shown.append((place, _named(numbers)))
    return shown


def _named(numbers: Sequence[int]) -> str:
    """1, 1–5, or 1, …"""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"{numbers[0]}–{numbers[-1]}"
    return f"{numbers[0]}, …" if len(numbers) > 2 else ", ".join(map(str, numbers))


def _fence(axes: Axes, mission: Mission) -> None:
    fence = mission.fence
    if fence is None:
        return
    local = LocalMap(mission.home.lat, mission.home.lon)
    if fence.max_distance_m is not None:
        axes.add_patch(_edge(Circle((0.0, 0.0), fence.max_distance_m), inside=True))
    for circle in fence.circles:
        north, east = local.to_local(circle.lat, circle.lon)
        axes.add_patch(_edge(Circle((east, north), circle.radius_m), inside=circle.inside))
    for polygon in fence.polygons:
        corners = [local.to_local(lat, lon) for lat, lon in polygon.points]
        axes.add_patch(_edge(Polygon([(east, north) for north, east in corners]), inside=polygon.inside))
    axes.plot([], [], color=_FENCE, linewidth=1.2, label="fence")


def _edge(patch: Circle | Polygon, *, inside: bool) -> Circle | Polygon:
    patch.set(fill=not inside, facecolor=_FORBIDDEN if not inside else "none", alpha=None if inside else 0.25)
    patch.set(edgecolor=_FENCE if inside else _FORBIDDEN, linewidth=1.2, zorder=0)
    return patch


def _frame(axes: Axes, places: np.ndarray, mission: Mission) -> None:
    """Room for the path; for the fence where it is not much larger."""
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float((high - low).max()), 10.0)
    fence = mission.fence
    reach = fence.max_distance_m if fence is not None else None
    if reach is not None and reach < 2.0 * size:
        low, high = np.minimum(low, -reach), np.maximum(high, reach)
    centre = 0.5 * (low + high)
    half = np.maximum(0.5 * (high - low), 0.25 * size) + _MARGIN * size
    axes.set(xlim=(centre[0] - half[0], centre[0] + half[0]), ylim=(centre[1] - half[1], centre[1] + half[1]))
