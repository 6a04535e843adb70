"""The report in a browser, whole: quiet, never sideways, within reach of everyone, small and quick."""

from __future__ import annotations

import time

import pytest
from tests.browser.conftest import OpenPage
from tests.browser.looking import overflow_of, settle, violations
from tests.browser.made_page import MadePage

from fusetune.report.flight_data.panel_names import GROUPS

WIDTHS = (390, 820, 1440)
MOST_BYTES = 5_000_000
"""Of a page for ten flights and eight sets."""
ALL_OPEN = ",".join(GROUPS)
"""Of the viewer, as the address names its open groups."""


@pytest.fixture(params=["made", "demonstration"])
def address(request: pytest.FixtureRequest) -> str:
    found = request.getfixturevalue(request.param)
    return found.url if isinstance(found, MadePage) else found


@pytest.mark.parametrize("width", WIDTHS)
def test_every_tab_fits_and_is_quiet(address: str, open_page: OpenPage, width: int) -> None:
    page = open_page(address, width, reduced_motion="reduce")
    tabs = page.get_by_role("tab")
    assert tabs.count() == 6
    for index in range(tabs.count()):
        tabs.nth(index).click()
        settle(page)
        assert tabs.nth(index).get_attribute("aria-selected") == "true"
        assert overflow_of(page) <= 0, tabs.nth(index).inner_text()
        page.evaluate("document.querySelectorAll('main details').forEach(one => one.open = true)")
        settle(page)
        assert overflow_of(page) <= 0, tabs.nth(index).inner_text()


@pytest.mark.parametrize(
    ("address", "scheme"), [("made", "light"), ("made", "dark"), ("demonstration", "dark")], indirect=["address"]
)
def test_nobody_is_kept_out(address: str, open_page: OpenPage, axe: str, scheme: str) -> None:
    """WCAG 2.1, levels A and AA, as far as axe-core can tell: all tabs at once, for it takes as long for each.

    Of the viewer two groups are open; the others are alike.
    """
    page = open_page(f"{address}#tab=flights&open=Test ratios,Flags", scheme=scheme)
    page.locator(".flight-viewer").scroll_into_view_if_needed()
    page.locator(".fv-groups .fv-figures-button").first.click()
    page.evaluate("document.querySelectorAll('.tab-panel').forEach(one => one.classList.add('is-open'))")
    settle(page)
    assert violations(page, axe) == []


def test_every_group_of_the_viewer_shows_what_it_says(address: str, open_page: OpenPage) -> None:
    page = open_page(f"{address}#tab=flights&open={ALL_OPEN}")
    page.locator(".flight-viewer").scroll_into_view_if_needed()
    page.locator(".fv-strip").wait_for()
    groups = page.locator(".fv-group")
    for group in groups.all():
        told = int(group.locator(".fv-group-button small").inner_text().split()[0])
        assert group.locator(".fv-panel:visible").count() == told
    last = groups.last.locator(".fv-plot").last
    last.scroll_into_view_if_needed()
    last.locator("canvas").first.wait_for()
    assert page.locator("canvas").count() < page.locator(".fv-plot").count(), "drawn before it was seen"


def test_it_is_small_and_opens_quickly(address: str, open_page: OpenPage, capsys: pytest.CaptureFixture[str]) -> None:
    """The time is told, not judged: it is that of a busy machine."""
    begun = time.perf_counter()
    page = open_page(address)
    opened = time.perf_counter() - begun
    begun = time.perf_counter()
    page.get_by_role("tab", name="Flights").click()
    page.locator(".flight-viewer").scroll_into_view_if_needed()
    page.locator(".fv-strip").wait_for()
    shown = time.perf_counter() - begun
    size = page.evaluate("document.documentElement.outerHTML.length")
    with capsys.disabled():
        told = f"{size / 1e6:.2f} MB, opened in {opened:.2f} s, a flight shown in {shown:.2f} s"
        print(f"\n{address.rsplit('/', 1)[1]}: {told}")
    assert size <= MOST_BYTES
