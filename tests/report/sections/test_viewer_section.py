"""Where the viewer stands in the report."""

from __future__ import annotations

from fusetune.report.page_shell.shell import FlightBlob
from fusetune.report.sections.flights_section import Logs
from fusetune.report.sections.viewer_section import viewer_section

LOGS = Logs({}, {}, {}, {"a": "report/flights/a.html"})


def test_it_begins_with_the_newest_flight_of_the_decision_that_it_has() -> None:
    blobs = [FlightBlob(name, b"") for name in ("a", "b&c", "z")]
    section = viewer_section(blobs, LOGS, ["a", "b&c", "not there"])
    assert '<div class="flight-viewer" data-choose data-first="b&amp;c"></div>' in section


def test_where_the_page_has_no_data_it_leads_to_the_flights_own_pages() -> None:
    section = viewer_section([], LOGS)
    assert "flight-viewer" not in section
    assert "do not fit into one page" in section
    assert viewer_section([], Logs({}, {}, {}, {})) == ""
