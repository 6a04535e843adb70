"""Chromium, the made report, and pages that tell what they complain about."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.browser.made_page import MadePage, make_page
from tests.shared_folder import ROOT

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

AXE = Path(__file__).parent / "node_modules" / "axe-core" / "axe.min.js"
HEIGHT_PX = 900
MOST_MS = 10_000

OpenPage = Callable[..., "Page"]


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """Debian's chromium, or Chrome; the tests are skipped where it or playwright is not there (`make with-browser`)."""
    api = pytest.importorskip("playwright.sync_api", reason="needs playwright: make with-browser")
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("needs chromium in the path")
    with api.sync_playwright() as playwright:
        # as root, as in a container, Chromium runs only without its sandbox; the pages are our own
        started = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> MadePage:
    return make_page(tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="session")
def demonstration() -> str:
    """Address of the report that the demonstration left in the checkout."""
    report = ROOT / "results" / "report.html"
    if not report.is_file() or "flight-data" not in report.read_text(encoding="utf-8"):
        pytest.skip("needs the report of a run in this checkout: make demonstration")
    return report.as_uri()


@pytest.fixture
def open_page(chromium: Browser) -> Iterator[OpenPage]:
    """Opens an address; whatever a page writes to the console, throws or asks of a network fails the test."""
    complaints: list[str] = []
    asked: list[str] = []
    opened_files: set[str] = set()
    contexts = []

    def opened(url: str, width: int = 1440, *, scheme: Any = "light", touch: bool = False, **more: Any) -> Page:
        context = chromium.new_context(
            viewport={"width": width, "height": HEIGHT_PX}, color_scheme=scheme, has_touch=touch, **more
        )
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(MOST_MS)
        page.on("console", lambda message: complaints.append(f"console: {message.text}"))
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        page.on("request", lambda request: asked.append(request.url))
        opened_files.add(url.partition("#")[0])
        page.goto(url)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert complaints == []
    assert set(asked) <= opened_files


@pytest.fixture(scope="session")
def axe() -> str:
    """Source of axe-core; the test is skipped where it is not there."""
    if not AXE.is_file():
        pytest.skip("needs axe-core: npm ci in tests/browser")
    return AXE.read_text(encoding="utf-8")
