"""What a reader does with a page, and sees of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, urlsplit

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

WRITTEN_AFTER_MS = 180
"""The page writes the address 150 ms after what it tells has changed."""


def panel_of(page: Page, name: str) -> Locator:
    """A panel of the viewer, drawn and in view."""
    panel = page.locator(f'[data-panel="{name}"]')
    panel.locator(".fv-plot").evaluate("element => element.scrollIntoView({block: 'center'})")
    panel.locator(".u-over").wait_for()
    return panel


def settle(page: Page) -> None:
    """Waits until what was asked for is drawn, and the address written."""
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    page.wait_for_timeout(WRITTEN_AFTER_MS)


def state_of(page: Page) -> dict[str, str]:
    """What the fragment of the address holds."""
    return dict(parse_qsl(urlsplit(page.url).fragment, keep_blank_values=True))


def window_of(page: Page) -> tuple[float, float]:
    """What is in view, s since the log began."""
    first, last = state_of(page)["t"].split(",")
    return float(first), float(last)


def overflow_of(page: Page) -> int:
    """By how many pixels the page is wider than its window."""
    return int(page.evaluate("document.documentElement.scrollWidth - innerWidth"))


def point_at(page: Page, panel: Locator, share: float) -> None:
    """Moves the mouse over a panel, `share` of its width from its left edge."""
    box = panel.locator(".u-over").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + share * box["width"], box["y"] + box["height"] / 2)
    settle(page)


def told_at_cursor(panel: Locator) -> dict[str, str]:
    """What a panel says of each curve where the cursor is."""
    return dict(
        zip(panel.locator(".fv-name").all_inner_texts(), panel.locator(".fv-value").all_inner_texts(), strict=True)
    )


def ink_of(canvas: Locator) -> int:
    """Number of pixels of a canvas that are not empty."""
    return int(
        canvas.evaluate(
            "c => { const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
            " let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 0; return n; }"
        )
    )


def violations(page: Page, axe: str) -> list[str]:
    """What axe-core finds against the levels A and AA, each in a line."""
    page.evaluate(axe)
    found: dict[str, Any] = page.evaluate(
        "axe.run(document, {runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa'], resultTypes: ['violations']})"
    )
    return [
        f"{one['id']}: {one['help']}: {node['target'][0]} {node.get('failureSummary', '')}"
        for one in found["violations"]
        for node in one["nodes"]
    ]
