"""What the truth says of a change: figures of a made study, exchanged for ones whose change follows by hand."""

import dataclasses
from pathlib import Path

import pandas as pd
import pytest

from fusetune.report.results import Results, read_results
from fusetune.report.sections.first_screen import first_screen
from fusetune.report.sections.truth_section import truth_section, truth_sentence


@pytest.fixture
def results(made: tuple[Path, str]) -> Results:
    """Of five flights that end in a change from `present` to `better`."""
    root, _ = made
    return read_results(sorted((root / "analyze").iterdir()), root / "apply")


def with_truth(results: Results, velocity: list[float], attitude: list[float], flights: int = 5) -> Results:
    """The results with true errors: 0.2 m/s and 1° of the present set; of the chosen one those given, by flight."""
    rows = []
    for flight in results.flights[:flights]:
        for source, present, chosen in (("truth_velocity", 0.2, velocity), ("truth_attitude_deg", 1.0, attitude)):
            for name, value in (("present", present), ("better", chosen[int(flight[-1])])):
                rows.append((flight, name, source, "all", "rmse", value))
    metrics = pd.DataFrame(rows, columns=["flight", "set", "source", "axis", "metric", "value"])
    return dataclasses.replace(results, metrics=metrics)


def test_a_truth_that_confirms_says_by_how_much(results: Results) -> None:
    """Means over the flights: 0.15 of 0.2 m/s is 25 % less, 0.9 of 1 degree is 10 % less."""
    known = with_truth(results, [0.13, 0.17, 0.15, 0.14, 0.16], [0.9] * 5)
    sentence = truth_sentence(known)
    assert sentence == (
        "The truth of these flights is known; the decision never looks at it. It confirms the change: true error of "
        "velocity −25 % (0.2 to 0.15 m/s), attitude −10 % (1 to 0.9°)."
    )
    assert sentence in truth_section(known).replace("&nbsp;", " ")
    assert "The known truth confirms the change." in first_screen(known)


def test_a_truth_that_confirms_in_part_or_not_at_all_is_said_as_plainly(results: Results) -> None:
    mixed = truth_sentence(with_truth(results, [0.1] * 5, [1.2] * 5, flights=2))
    assert mixed.startswith("The truth of 2 of the flights is known;")
    assert "It confirms the change in velocity, not in attitude: true error of velocity −50 %" in mixed
    assert "attitude +20 % (1 to 1.2°)." in mixed
    against = truth_sentence(with_truth(results, [0.3] * 5, [1.2] * 5))
    assert "It speaks against the change: true error of velocity +50 %" in against


def test_without_a_change_or_a_truth_nothing_is_said(results: Results) -> None:
    known = with_truth(results, [0.15] * 5, [0.9] * 5)
    kept = dataclasses.replace(known, decision=known.decision | {"status": "keep", "chosen": "present"})
    assert truth_sentence(kept) == ""
    assert truth_sentence(dataclasses.replace(known, metrics=known.metrics.iloc[:0])) == ""
    assert "truth" not in first_screen(kept)


def test_errors_that_are_equal_confirm_nothing(results: Results) -> None:
    equal = truth_sentence(with_truth(results, [0.2] * 5, [1.0] * 5))
    assert "It shows no difference: true error of velocity +0 %" in equal
