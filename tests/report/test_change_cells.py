"""Cells of a heat map by hand."""

import numpy as np
import pytest

from fusetune.report.change_cells import cell_words, colour_reach


def test_a_hopeless_set_takes_the_end_of_the_colours_and_leaves_the_others_theirs() -> None:
    # the third set is beyond three times the usual 5 %; nine tenths of the way from 4 to 6 among four figures
    values = np.array([[-4.0, 5.0, 300.0], [-6.0, 5.0, 200.0]])
    assert colour_reach(values) == pytest.approx(np.quantile([4.0, 5.0, 5.0, 6.0], 0.9))
    assert colour_reach(np.array([[0.1, -0.2]])) == 1.0


def test_a_set_that_no_flight_tells_of_changes_nothing() -> None:
    values = np.array([[-4.0, np.nan], [-6.0, np.nan]])
    assert colour_reach(values) == pytest.approx(5.8)
    assert colour_reach(np.full((2, 1), np.nan)) == 1.0


def test_cells_hold_few_signs() -> None:
    told = [cell_words(one) for one in (-12.34, 3.21, 0.0, float("nan"), 4321.0, -9.5)]
    assert told == ["−12", "+3.2", "=", "–", "≫", "−10"]
