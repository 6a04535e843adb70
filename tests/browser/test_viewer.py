"""The viewer of flights as it is used: choose, zoom, point, jump, share, print."""

from __future__ import annotations

import base64
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.analyze.made_flight import END_S, START_US
from tests.browser.conftest import OpenPage
from tests.browser.looking import (
    ink_of,
    overflow_of,
    panel_of,
    point_at,
    settle,
    state_of,
    told_at_cursor,
    window_of,
)
from tests.browser.made_page import LONG_NAME, MadePage
from tests.report.made_health import LANDING_S, TAKE_OFF_S

from fusetune.analyze.flight_files import SAMPLES_FILE
from fusetune.report.flight_data.blob import unpack
from fusetune.report.scored_samples import scored_samples
from fusetune.storage.parquet import read_table

if TYPE_CHECKING:
    from playwright.sync_api import Page

WIDTHS = (390, 820, 1440)
NORTH = "innovation.gnss_vel.0"


def flights_of(made: MadePage, **more: str) -> str:
    return f"{made.url}#" + "&".join(f"{key}={value}" for key, value in {"tab": "flights", **more}.items())


def folder_of(made: MadePage, flight: str) -> Path:
    return next(folder for folder in made.folders if folder.name == flight)


def replayed(made: MadePage, flight: str) -> tuple[np.ndarray, np.ndarray]:
    """Innovations of the present set's velocity to the north in its own file: s since the log began, m/s."""
    table = read_table(folder_of(made, flight) / "present.innovations.parquet").to_pandas()
    rows = table[(table["source"] == "gnss_vel") & (table["axis"] == 0)]
    return (rows["timestamp_sample"].to_numpy() - START_US) * 1e-6, rows["innovation"].to_numpy()


def scored(made: MadePage, flight: str, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of another set the innovations that are scored, with their test ratios."""
    columns = ("time_us", "innovation", "test_ratio")
    parts = [
        one.columns
        for one in scored_samples(folder_of(made, flight) / SAMPLES_FILE, columns)
        if (one.set_name, one.source, one.axis) == (name, "gnss_vel", 0)
    ]
    time_us, innovation, ratio = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return (time_us - START_US) * 1e-6, innovation, ratio


def four_digits(value: float) -> str:
    """As the viewer tells a figure of some 1e-3 to 1e3."""
    return f"{value:#.4g}".rstrip(".").replace("-", "−")


@pytest.mark.parametrize("width", WIDTHS)
def test_every_control_works(made: MadePage, open_page: OpenPage, width: int) -> None:
    page = open_page(flights_of(made), width, touch=width == WIDTHS[0])
    panel = panel_of(page, NORTH)
    assert overflow_of(page) <= 0
    earlier, newest = made.flights

    assert page.get_by_label("Flight", exact=True).input_value() == newest
    page.get_by_role("button", name="Flight before").click()
    settle(page)
    assert state_of(page)["flight"] == earlier
    page.get_by_role("button", name="Flight after").click()
    settle(page)
    assert "flight" not in state_of(page)
    page.get_by_label("Flight", exact=True).select_option(earlier)
    settle(page)
    assert state_of(page)["flight"] == earlier
    assert page.locator(".fv-strip").count() == 1

    names = page.locator(f'[data-panel="{NORTH}"] .fv-name')
    shown = names.all_inner_texts()
    page.locator('.fv-chip[data-set="rejecting"]').click()
    settle(page)
    assert set(names.all_inner_texts()) == {*shown, "rejecting"}
    page.get_by_role("button", name="all", exact=True).click()
    settle(page)
    assert len(names.all_inner_texts()) == 6
    assert LONG_NAME in state_of(page)["sets"]
    page.get_by_role("button", name="usual").click()
    settle(page)
    assert names.all_inner_texts() == shown
    assert "sets" not in state_of(page)

    def click(label: str) -> None:
        page.get_by_role("button", name=label, exact=True).click()
        settle(page)

    click("in the air")
    assert window_of(page) == pytest.approx((TAKE_OFF_S, LANDING_S), abs=0.2)
    click("Closer")
    closer = window_of(page)
    assert closer[1] - closer[0] == pytest.approx(0.5 * (LANDING_S - TAKE_OFF_S), abs=0.2)
    click("Later")
    assert window_of(page)[0] > closer[0]
    click("Earlier")
    assert window_of(page) == pytest.approx(closer, abs=1e-3)
    click("Wider")
    click("Whole flight")
    assert "t" not in state_of(page)
    assert page.get_by_role("button", name="Whole flight", exact=True).is_disabled()

    # by key: below a pointer that rests the page would move, and the cursor go with it
    page.mouse.move(1, 1)
    page.locator('[data-finding="vibration"]').press("Enter")
    settle(page)
    t0, t1 = window_of(page)
    assert t0 < 20.0 < 32.5 < t1  # of SHAKEN
    assert t1 - t0 < 30.0
    assert page.locator(".fv-cursor").inner_text().startswith("10.00 s after take-off")

    page.locator('[data-source="gnss_vel"]').first.click()
    settle(page)
    assert page.locator('[data-group="Innovations"] .fv-panel:visible').count() == 3
    page.get_by_role("button", name="All sources").first.click()
    page.get_by_label("whole gate in view").check()
    settle(page)
    assert state_of(page)["gate"] == "1"

    for group in ("Test ratios", "Flags"):
        page.locator(f'[data-group="{group}"] .fv-group-button').click()
    settle(page)
    assert state_of(page)["open"] == "Innovations,Test ratios,Flags"
    page.get_by_label("logarithmic").uncheck()
    settle(page)
    assert state_of(page)["log"] == "0"
    assert page.locator('[data-panel="bands"] canvas').is_visible()

    page.get_by_role("button", name="Map closer").click()
    page.get_by_role("button", name="Whole track").click()
    page.get_by_label("colour:").select_option("manoeuvre")
    settle(page)
    assert state_of(page)["map"] == "manoeuvre"
    assert "turn" in page.locator(".fv-map-legend").inner_text()

    panel = panel_of(page, NORTH)
    panel.locator(".fv-figures-button").click()
    assert panel.locator("table").is_visible()
    page.get_by_role("button", name="What mouse, fingers and keys do").click()
    assert "zoom to a part of the flight" in page.locator(".fv-help").inner_text()
    assert overflow_of(page) <= 0


def test_what_is_pointed_at_is_what_parquet_holds(made: MadePage, open_page: OpenPage) -> None:
    """The sample with the largest innovation of a set, found by zooming to it."""
    flight = made.flights[0]
    time, value, ratio = scored(made, flight, "rejecting")
    peak = int(np.argmax(np.abs(value)))
    assert ratio[peak] > 1.0  # of errors of 0.9 m/s, where the gate is at 1 m/s
    window = f"{time[peak] - 0.25:.4f},{time[peak] + 0.25:.4f}"
    page = open_page(flights_of(made, flight=flight, sets="present,rejecting", t=window))
    panel = panel_of(page, NORTH)
    point_at(page, panel, 0.5)
    told = told_at_cursor(panel)
    assert told["rejecting"].startswith(f"{four_digits(value[peak])} m/s")
    assert told["rejecting"].endswith("rejected")
    own_time, own = replayed(made, flight)
    at_cursor = int(np.argmin(np.abs(own_time - time[peak])))
    assert told["present"].startswith(f"{four_digits(own[at_cursor])} m/s")
    # claimed 0.3 m/s of itself
    assert f"({own[at_cursor] / 0.3:.1f} σ)".replace("-", "−") in told["present"]
    # every other panel tells of the same moment
    assert told_at_cursor(page.locator('[data-panel="innovation.gnss_vel.1"]'))["present"]
    moment = page.locator(".fv-cursor").inner_text()
    assert float(moment.split(" s ")[0]) == pytest.approx(time[peak] - TAKE_OFF_S, abs=2e-3)
    assert "s after take-off" in moment


def test_figures_of_a_panel_are_those_of_parquet(made: MadePage, open_page: OpenPage) -> None:
    flight = made.flights[-1]
    _, value, ratio = scored(made, flight, "rejecting")
    page = open_page(flights_of(made, sets="rejecting"))
    panel = panel_of(page, NORTH)
    panel.locator(".fv-figures-button").click()
    name, least, _, most, _, lost = panel.locator("tbody tr").first.locator("th, td").all_inner_texts()
    assert (name, least, most) == ("rejecting", four_digits(value.min()), four_digits(value.max()))
    assert lost == f"{100 * np.mean(ratio > 1.0):.1f} % rejected"
    described = panel.locator(".fv-plot").get_attribute("aria-label") or ""
    assert f"from {four_digits(value.min())} to {four_digits(value.max())} m/s, {lost}" in described


def test_drag_wheel_keys_and_double_click_move_the_axis_of_all_panels(made: MadePage, open_page: OpenPage) -> None:
    page = open_page(flights_of(made))
    panel = panel_of(page, NORTH)
    box = panel.locator(".u-over").bounding_box()
    assert box is not None
    x, y = (lambda share: box["x"] + share * box["width"]), box["y"] + 0.5 * box["height"]
    canvas = page.locator('[data-panel="innovation.gnss_vel.1"] canvas')
    before = canvas.evaluate("c => c.toDataURL()")
    page.mouse.move(x(0.2), y)
    page.mouse.down()
    page.mouse.move(x(0.4), y, steps=3)
    page.mouse.up()
    settle(page)
    assert window_of(page) == pytest.approx((0.2 * END_S, 0.4 * END_S), abs=0.2)
    assert canvas.evaluate("c => c.toDataURL()") != before

    page.keyboard.down("Control")
    page.mouse.wheel(0, 200)
    page.keyboard.up("Control")
    settle(page)
    assert np.diff(window_of(page))[0] > 0.25 * END_S
    scrolled = page.evaluate("scrollY")
    page.mouse.wheel(0, 120)
    settle(page)
    assert page.evaluate("scrollY") > scrolled  # the wheel alone scrolls the page
    panel_of(page, NORTH).locator(".u-over").dblclick()
    settle(page)
    assert "t" not in state_of(page)

    strip = page.get_by_role("slider", name="moment of the flight")
    strip.focus()
    page.keyboard.press("+")
    settle(page)
    half = window_of(page)
    assert half[1] - half[0] == pytest.approx(END_S / 2, abs=0.1)
    page.keyboard.press("Shift+ArrowRight")
    settle(page)
    assert window_of(page)[0] == pytest.approx(half[0] + 0.1 * (half[1] - half[0]), abs=0.01)
    page.keyboard.press("-")
    page.keyboard.press("Escape")
    settle(page)
    assert "t" not in state_of(page)
    page.keyboard.press("ArrowRight")
    settle(page)
    told = strip.get_attribute("aria-valuetext")
    assert told
    assert told.startswith(page.locator(".fv-cursor").inner_text().split(" s ")[0][:3])
    page.keyboard.press("+")
    page.keyboard.press("0")
    settle(page)
    assert "t" not in state_of(page)


def test_fingers_move_the_cursor_and_zoom(made: MadePage, open_page: OpenPage) -> None:
    page = open_page(flights_of(made), 390, touch=True)
    panel = panel_of(page, NORTH)
    over = panel.locator(".u-over")

    def touch(kind: str, finger: int, share: float) -> None:
        over.evaluate(
            """(element, [kind, finger, share]) => {
              const box = element.getBoundingClientRect();
              const at = {clientX: box.x + share * box.width, clientY: box.y + 50};
              element.dispatchEvent(new PointerEvent(kind, {pointerId: finger, pointerType: "touch", ...at}));
            }""",
            [kind, finger, share],
        )

    touch("pointerdown", 1, 0.4)
    touch("pointermove", 1, 0.5)
    settle(page)
    assert page.locator(".fv-cursor").inner_text().startswith(f"{0.5 * END_S - TAKE_OFF_S:.0f}"[:1])
    assert told_at_cursor(panel)["present"]
    touch("pointerdown", 2, 0.6)
    touch("pointermove", 2, 0.7)  # twice as far apart
    settle(page)
    first, last = window_of(page)
    assert last - first == pytest.approx(END_S / 2, rel=0.05)


def test_the_address_restores_what_is_seen(made: MadePage, open_page: OpenPage) -> None:
    page = open_page(flights_of(made))
    panel_of(page, NORTH)
    page.get_by_role("button", name="Flight before").click()
    page.locator('.fv-chip[data-set="better"]').click()
    page.locator(f'.fv-chip[data-set="{LONG_NAME}"]').click()
    page.locator('[data-group="Flags"] .fv-group-button').click()
    page.locator('[data-finding="vibration"]').click()
    page.locator('[data-source="gnss_vel"]').first.click()
    settle(page)

    def seen(page: Page) -> dict[str, object]:
        pressed = page.locator('.fv-chip[aria-pressed="true"]').all_inner_texts()
        return {
            "state": state_of(page),
            "pressed": pressed,
            "range": page.locator(".fv-window").inner_text(),
            "open": page.locator('.fv-group-button[aria-expanded="true"]').all_inner_texts(),
            "panels": page.locator(".fv-groups .fv-panel:visible h4").all_inner_texts(),
            "flight": page.get_by_label("Flight", exact=True).input_value(),
        }

    other = open_page(page.url)
    other.locator(".fv-strip").wait_for()
    settle(other)
    assert seen(other) == seen(page)
    page.go_back()
    page.locator(".fv-strip").wait_for()
    settle(page)
    assert page.get_by_label("Flight", exact=True).input_value() == made.flights[-1]


def test_one_axis_can_be_asked_for(made: MadePage, open_page: OpenPage) -> None:
    page = open_page(flights_of(made, source="gnss_vel", axis="1"))
    page.locator(".fv-strip").wait_for()
    settle(page)
    assert page.locator(".fv-groups .fv-panel:visible h4").all_inner_texts() == ["GNSS velocity east m/s"]


def test_the_map_tells_where_the_vehicle_was(made: MadePage, open_page: OpenPage) -> None:
    """At the north-west corner of the square, after 15 s, the cursor stands when the map is pointed at there."""
    page = open_page(flights_of(made))
    page.locator(".fv-map canvas").wait_for()
    page.locator(".fv-map").scroll_into_view_if_needed()
    settle(page)
    described = page.locator(".fv-map").get_attribute("aria-label") or ""
    assert "40.00 m from south to north, 40.00 m from west to east" in described
    box = page.locator(".fv-map canvas").bounding_box()
    assert box is not None
    side = min(box["width"], box["height"]) - 2 * 26
    page.mouse.move(box["x"] + (box["width"] - side) / 2, box["y"] + (box["height"] - side) / 2)
    settle(page)
    told = page.locator(".fv-cursor").inner_text()
    assert float(told.split(" s ")[0]) == pytest.approx(15.0, abs=0.6)
    assert "height 10.00 m" in told


def test_the_theme_changes_what_is_drawn(made: MadePage, open_page: OpenPage) -> None:
    page = open_page(flights_of(made))
    canvas = panel_of(page, NORTH).locator("canvas")
    settle(page)
    light = canvas.evaluate("c => c.toDataURL()")
    page.locator(".theme-switch").click()
    panel_of(page, NORTH)
    settle(page)
    assert canvas.evaluate("c => c.toDataURL()") != light
    page.locator(".theme-switch").click()
    panel_of(page, NORTH)
    settle(page)
    assert canvas.evaluate("c => c.toDataURL()") == light


def test_nothing_closed_is_drawn_and_paper_gets_what_is_open(made: MadePage, open_page: OpenPage) -> None:
    page = open_page(flights_of(made, open="Test ratios"), scheme="dark")
    page.locator(".fv-strip").wait_for()
    settle(page)
    assert page.locator('[data-group="Innovations"] canvas').count() == 0
    panels = page.locator('[data-group="Test ratios"] .fv-panel')
    before = page.locator('[data-group="Test ratios"] canvas').count()
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    settle(page)
    canvases = page.locator('[data-group="Test ratios"] canvas')
    assert canvases.count() == panels.count() >= before
    assert all(ink_of(canvases.nth(i)) > 1000 for i in range(canvases.count()))
    assert page.locator('[data-group="Innovations"] .fv-print-hint').is_visible()
    assert page.locator(".fv-toolbar").is_hidden()
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    page.emulate_media(media="screen")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    settle(page)
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"


def test_nothing_is_left_in_the_browser_but_the_page_itself(
    made: MadePage, open_page: OpenPage, tmp_path: Path
) -> None:
    (tmp_path / "empty.html").write_text('<!DOCTYPE html><html lang="en"><title>Empty</title></html>', encoding="utf-8")
    empty = open_page((tmp_path / "empty.html").as_uri()).evaluate("Object.keys(window)")
    page = open_page(flights_of(made))
    panel_of(page, NORTH)
    assert set(page.evaluate("Object.keys(window)")) - set(empty) <= {"fusetune", "uPlot"}
    page.evaluate("document.querySelector('.flight-viewer').remove()")
    assert page.locator("main [style]").count() == 0


def test_the_browser_unpacks_what_was_packed(made: MadePage, open_page: OpenPage) -> None:
    """Every array, compared by its sum, its number of values that are none, and its last value."""
    blob = made.blobs[0].read_bytes()
    page = open_page(made.url)
    found = page.evaluate(
        """async text => {
          const {header, array} = await fusetune.viewer.decode(text);
          return header.arrays.map((_, k) => {
            const known = [...array(k)].filter(value => !Number.isNaN(value));
            return [known.reduce((a, b) => a + b, 0), known.length, known.at(-1) ?? null];
          });
        }""",
        base64.b64encode(blob).decode(),
    )
    arrays = unpack(blob).arrays
    assert len(found) == len(arrays)
    for (total, count, last), values in zip(found, arrays, strict=True):
        known = values[~np.isnan(values)] if values.dtype.kind == "f" else values
        assert count == known.size
        assert math.isclose(total, float(known.astype(np.float64).sum()), rel_tol=1e-9, abs_tol=1e-9)
        assert last is None or last == pytest.approx(float(known[-1]), rel=1e-12)


def test_a_damaged_flight_is_told_and_the_others_are_shown(made: MadePage, open_page: OpenPage, tmp_path: Path) -> None:
    text = made.report.read_text(encoding="utf-8")
    start = text.index(f'data-flight="{made.flights[-1]}">', text.index('class="flight-data"')) + 200
    damaged = tmp_path / "report.html"
    damaged.write_text(text[:start] + "AAAA" + text[start + 4 :], encoding="utf-8")
    page = open_page(f"{damaged.as_uri()}#tab=flights")
    page.locator(".fv-status", has_text="cannot be shown").wait_for()
    page.get_by_role("button", name="Flight before").click()
    panel_of(page, NORTH)
