"""What all pages have in common: the policy, tabs, words of the field, short names, data of flights."""

from __future__ import annotations

import base64
from pathlib import Path

import pytest
from tests.report.read_page import Page, check_page

from fusetune.report.markup import paragraph, section
from fusetune.report.page_shell.glossary import TERMS, with_terms_marked
from fusetune.report.page_shell.shell import FlightBlob, PageHead, Tab, page_links, write_page
from fusetune.report.page_shell.text_pass import map_text, with_short_names

HEAD = PageHead("<title>", "<heading>", "<origin>")
HOSTILE = '"><script>alert(1)</script><b onclick="x" title=\'y\'>&amp;'


def written(folder: Path, *tabs: Tab, **more: object) -> Page:
    write_page(folder / "page.html", HEAD, tabs, **more)  # type: ignore[arg-type]
    return check_page((folder / "page.html").read_text(encoding="utf-8"))


def test_of_several_tabs_the_first_is_open_and_each_names_its_panel(tmp_path: Path) -> None:
    page = written(tmp_path, Tab("one", "One", section("A", "<p>a</p>")), Tab("two", "Two & three", "<p>b</p>"))
    tabs = [one for one in page.elements if one.attributes.get("role") == "tab"]
    assert [one.text for one in tabs] == ["One", "Two & three"]
    assert [one.attributes["aria-selected"] for one in tabs] == ["true", "false"]
    panels = [page.with_id(one.attributes["aria-controls"]) for one in tabs]
    assert ["is-open" in one.classes for one in panels] == [True, False]
    assert [one.text for one in page.all("h1")] == ["<heading>"]


def test_a_single_part_has_no_tab_bar_and_no_viewer_that_it_does_not_need(tmp_path: Path) -> None:
    page = written(tmp_path, Tab("one", "One", "<p>a</p>"))
    assert not any(one.attributes.get("role") in ("tab", "tablist", "tabpanel") for one in page.elements)
    (script,) = page.all("script")
    assert "uPlot" not in script.text
    with_viewer = written(tmp_path, Tab("one", "One", '<div class="flight-viewer" data-flight="a"></div>'))
    assert "uPlot" in with_viewer.all("script")[0].text


def test_data_of_flights_come_back_as_they_were_and_hostile_words_do_nothing(tmp_path: Path) -> None:
    data = bytes(range(256))
    tabs = (Tab("one", HOSTILE, paragraph(HOSTILE)), Tab("two", "Two", ""))
    page = written(tmp_path, *tabs, blobs=[FlightBlob(HOSTILE, data)], names={HOSTILE: "h"})
    (blob,) = page.all("script", "flight-data")
    assert base64.b64decode(blob.text) == data
    assert blob.attributes["data-flight"] == HOSTILE
    assert len(page.all("script")) == 2
    assert not page.all("b")


def test_a_term_is_marked_where_it_first_stands_in_a_tab_and_listed_once(tmp_path: Path) -> None:
    words = "<p>An innovation, Innovations, the innovation variance; the NIS, nis.</p><p><code>gate</code> gate</p>"
    page = written(tmp_path, Tab("one", "One", words), Tab("two", "Two", words))
    marked = [(one.attributes["data-term"], one.text) for one in page.all("dfn")]
    once = [
        ("innovation", "innovation"),
        ("innovation-variance", "innovation variance"),
        ("nis", "NIS"),
        ("gate", "gate"),
    ]
    assert marked == [*once, *once]
    assert [one.text for one in page.all("dt")] == ["gate", "innovation", "innovation variance", "NIS"]


def test_terms_stand_in_the_order_of_the_alphabet_and_no_spelling_twice() -> None:
    names = [term.name.lower() for term in TERMS]
    assert names == sorted(names)
    spellings = [one.lower() for term in TERMS for one in term.written]
    assert len(spellings) == len(set(spellings))
    assert len({term.id for term in TERMS}) == len(TERMS)


def test_no_term_is_marked_within_links_code_headings_or_pictures() -> None:
    html = '<h2>NIS</h2><a href="x">NIS</a><svg><text>NIS</text></svg><span class="whole">NIS</span>'
    used: set[str] = set()
    assert with_terms_marked(html, used) == html
    assert not used


def test_names_are_short_in_words_and_pictures_and_whole_where_they_are_listed() -> None:
    name = "owner__a&b_2021-8-12-15-53-14"
    escaped = "owner__a&amp;b_2021-8-12-15-53-14"
    html = (
        f'<p title="{escaped}">on {escaped}</p><svg><text>{escaped}</text><title>{escaped}</title></svg>'
        f'<table class="whole"><tbody><tr><td>{escaped}</td></tr></tbody></table><code>{escaped}</code>'
    )
    assert with_short_names(html, {name: "a&b", "other": "other"}) == (
        f'<p title="{escaped}">on <abbr title="{escaped}">a&amp;b</abbr></p>'
        f"<svg><text>a&amp;b</text><title>{escaped}</title></svg>"
        f'<table class="whole"><tbody><tr><td>{escaped}</td></tr></tbody></table><code>{escaped}</code>'
    )


@pytest.mark.parametrize("html", ["", "a", "<br>a<img alt='b'>c", "<p>a</p>b", "<i>a<b>c</b></i>d"])
def test_only_text_is_changed(html: str) -> None:
    assert map_text(html, lambda text: text) == html
    assert map_text(html, str.upper).lower() == html


def test_links_to_other_pages_are_relative() -> None:
    assert page_links({"The <decision>": "results/report.html"}, "results/report/flights/a.html") == (
        '<a href="../../report.html">The &lt;decision&gt;</a>'
    )
