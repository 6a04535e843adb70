"""What the page says of a search."""

from __future__ import annotations

from tests.report.made_search import made_search, parameter, part

from fusetune.report.search_results import SearchResults
from fusetune.report.sections.search_section import search_answer, search_evidence, search_found


def whole(results: SearchResults) -> str:
    """All that is said of a search."""
    return search_answer(results) + search_found(results) + search_evidence(results)


def cells(page: str, name: str) -> list[str]:
    """Texts of the row of a parameter."""
    row = page.partition(f">{name}<")[2].partition("</tr>")[0]
    return [one.partition("<")[0] for one in row.split('">')[1:]]


def test_the_answer_stands_first_and_says_what_it_is_worth() -> None:
    box = search_answer(made_search())
    assert "<h2>Change 1 parameter, from 4 flights</h2>" in box
    assert box.index("<h2>") < box.index("4.0&nbsp;% smaller")
    assert "4.0&nbsp;% smaller on flights that were kept aside from it, and 9.0&nbsp;% smaller on those" in box
    assert "expect them from 1.0&nbsp;% larger to 9.0&nbsp;% smaller (95&nbsp;%)" in box
    assert "&lt;attitude&gt;" in box, "cautions stand there, and what files say is escaped"


def test_where_it_is_not_taken_it_says_what_was_found_and_why_not() -> None:
    box = search_answer(made_search("keep"))
    assert "Keep the parameters that fly now" in box
    assert "Found, and not taken: EKF2_GPS_V_NOISE 0.3 → 0.15 m/s." in box
    assert "do not show beyond doubt" in box
    objected = search_answer(made_search("keep", objections=["flight 2: more resets"]))
    assert "Against it: flight 2: more resets." in objected


def test_the_table_tells_put_back_from_not_determined() -> None:
    page = whole(made_search())
    assert "put back: 2.8 gained next to nothing" in page
    assert cells(page, "EKF2_GPS_V_NOISE")[:2] == ["0.3", "0.15"]
    assert page.index(">EKF2_GPS_V_NOISE<") < page.index(">EKF2_BARO_NOISE<"), "what changes stands first"
    found = made_search().search["parameters"] | {
        "EKF2_GPS_V_NOISE": parameter("EKF2_GPS_V_NOISE", at_bound="lowest"),
    }
    assert "not determined: lowest value that was tried" in whole(made_search(parameters=found))


def test_what_goes_along_with_a_longer_delay_is_in_the_table() -> None:
    found = {"EKF2_GPS_V_NOISE": 0.15, "EKF2_DELAY_MAX": 220.0}
    page = whole(made_search(parameters_found=found))
    assert "goes along with the longer delay" in page.partition("EKF2_DELAY_MAX")[2].partition("</tr>")[0]


def test_how_many_sets_and_which_flights_were_left_out_is_told() -> None:
    page = whole(made_search())
    assert "30 sets on 4 flights" in page
    assert "without each of 2 parts" in page
    assert "e: left out, its replay has trust grade D" in page


def single() -> SearchResults:
    return made_search(
        "keep",
        exploratory=True,
        searches=[part("all flights", (), 9.0, None, 0.15)],
        kept_aside={},
        gain_kept_aside_percent=None,
        expected_gain=None,
        flights=["a"],
    )


def test_of_a_single_flight_it_is_exploratory_and_says_that_luck_cannot_be_seen() -> None:
    page = whole(single())
    assert '<span class="tag is-warning">exploratory</span>' in page
    assert "nothing shows how much of that is luck" in page
    assert "A single flight leaves none to keep aside" in page
