"""The answer of a search in a few lines."""

from __future__ import annotations

from typing import Any

from fusetune.apply.search.answer import answer_lines


def documents(status: str, changes: int, **other: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    names = [f"EKF2_P{number}" for number in range(changes)]
    one = {"present": 1.0, "found": 2.0, "is_changed": True, "alone_percent": 3.0, "at_bound": ""}
    search = {
        "flights": ["a"] * 8,
        "exploratory": False,
        "parameters": dict.fromkeys(names, one),
        "gain_in_search_percent": 12.0,
        "gain_kept_aside_percent": 4.0,
        "expected_gain": {"percent": 4.0, "lower_percent": 1.0, "upper_percent": 7.0},
        "objections": [],
    }
    changed = [{"name": name, "previous": 1.0, "value": 2.0, "unit": "m"} for name in names]
    decision = {
        "status": status,
        "chosen": "found" if status == "change" else "present",
        "changes": changed if status == "change" else [],
        "ranking": [],
        "next_steps": [{"text": "Fly."}],
    }
    return search | other, decision


def test_what_to_change_comes_first_and_each_line_says_what_it_brings() -> None:
    lines = answer_lines(*documents("change", 2), ["A matters.", "B does not."])
    assert lines == [
        "Change 2 parameters, from 8 flights.",
        "  EKF2_P0  1 → 2 m  without it errors 3.0 % larger",
        "  EKF2_P1  1 → 2 m  without it errors 3.0 % larger",
        "With what the search found, prediction errors are 4.0 % smaller on flights that were kept aside from it, and "
        "12.0 % smaller on those that it saw. On as many flights again expect them 1.0 to 7.0 % smaller (95 %).",
        "A matters.",
        "Next: Fly.",
    ]


def test_of_many_parameters_the_first_are_named_so_that_ten_lines_hold_it() -> None:
    lines = answer_lines(*documents("change", 12), ["A matters."])
    assert len(lines) <= 10
    assert "  and 7 more" in lines


def test_a_value_at_a_bound_is_not_determined() -> None:
    search, decision = documents("change", 1)
    search["parameters"]["EKF2_P0"] = search["parameters"]["EKF2_P0"] | {"at_bound": "highest"}
    assert "not determined: the highest value that was tried" in answer_lines(search, decision, [])[1]


def test_where_the_present_set_stays_it_says_what_was_found_and_why_it_is_not_taken() -> None:
    text = "\n".join(answer_lines(*documents("keep", 1, objections=["flight 1: more resets"]), []))
    assert text.startswith("Keep the parameters that fly now, from 8 flights.")
    assert "Found, and not taken: EKF2_P0 1 → 2." in text
    assert "Against it: flight 1: more resets." in text


def test_a_gain_that_is_a_loss_on_flights_kept_aside_is_told_as_one() -> None:
    text = "\n".join(answer_lines(*documents("keep", 1, gain_kept_aside_percent=-2.0), []))
    assert "2.0 % larger on flights that were kept aside from it, and 12.0 % smaller on those that it saw" in text


def test_where_nothing_was_found_there_is_nothing_to_doubt() -> None:
    text = "\n".join(answer_lines(*documents("keep", 0), []))
    assert "found nothing that is better" in text
    assert "Against it" not in text


def test_where_a_single_effect_is_chosen_what_was_found_is_told_as_not_taken() -> None:
    search, decision = documents("change", 1)
    decision |= {"chosen": "antenna_mended"}
    lines = answer_lines(search, decision, [])
    assert lines[1] == "  EKF2_P0  1 → 2 m"
    text = "\n".join(lines)
    assert "Found, and not taken: EKF2_P0 1 → 2." in text
    assert "Against it: antenna_mended, a single effect as the flights measure it, is to be preferred." in text
