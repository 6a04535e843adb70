"""Flight cards: what stands on them, and input that cannot be planned from."""

import re
from pathlib import Path

import pytest

from fusetune.design.flight_cards import cards_page, plan_cards, write_cards
from fusetune.errors import UserError
from fusetune.px4.parameters.params_file import ParamEntry, write_params


def params(folder: Path, name: str, **values: float) -> Path:
    write_params(folder / f"{name}.params", [ParamEntry(key, value, "FLOAT") for key, value in values.items()])
    return folder / f"{name}.params"


def test_a_study_is_made_up_to_whole_blocks(project_root: Path) -> None:
    cards = plan_cards([project_root / "config" / "studies" / "paper_table11.yaml"], 13, 1)
    assert (cards.flights, len(cards.blocks)) == (18, 3)
    page = cards_page(cards)
    assert re.findall(r'<td class="number">(\d+)</td>', page) == [str(number) for number in range(1, 19)]
    assert len(re.findall(r"<small>paper4.params</small>", page)) == 3


def test_parameters_that_would_stay_from_the_set_before_are_told(tmp_path: Path) -> None:
    """b does not name the gyroscope's noise: after a it would fly with a's."""
    a = params(tmp_path, "a", EKF2_ACC_NOISE=0.3, EKF2_GYR_NOISE=0.02)
    b = params(tmp_path, "b", EKF2_ACC_NOISE=0.5)
    assert plan_cards([a, b], 4, 1).not_named_by_all == ("EKF2_GYR_NOISE",)
    assert "Load the saved parameters before each set: not all sets name EKF2_GYR_NOISE" in cards_page(
        plan_cards([a, b], 4, 1)
    )
    same = params(tmp_path, "c", EKF2_ACC_NOISE=0.5, EKF2_GYR_NOISE=0.015)
    assert "Load the saved" not in cards_page(plan_cards([a, same], 4, 1))


def test_only_sets_that_need_it_have_a_reboot_to_tick(tmp_path: Path) -> None:
    """EKF2_GPS_DELAY takes effect after a reboot, EKF2_ACC_NOISE at once (PX4's metadata)."""
    files = [params(tmp_path, "delay", EKF2_GPS_DELAY=160.0), params(tmp_path, "noise", EKF2_ACC_NOISE=0.5)]
    cards = plan_cards(files, 2, 1)
    assert {one.name: one.needs_reboot for one in cards.sets} == {"delay": True, "noise": False}


def test_names_are_escaped(tmp_path: Path) -> None:
    files = [params(tmp_path, "<b>", EKF2_ACC_NOISE=0.3), params(tmp_path, "c", EKF2_ACC_NOISE=0.5)]
    assert "<b><b></b>" not in cards_page(plan_cards(files, 2, 1))


@pytest.mark.parametrize("names", [("a",), ("a", "a")])
def test_one_set_or_the_same_name_twice_cannot_be_compared(tmp_path: Path, names: tuple[str, ...]) -> None:
    for number, name in enumerate(names):
        (tmp_path / str(number)).mkdir()
        params(tmp_path / str(number), name, EKF2_ACC_NOISE=0.3)
    with pytest.raises(UserError, match=r"a\.params"):
        plan_cards([tmp_path / str(number) / f"{name}.params" for number, name in enumerate(names)], 4, 1)


@pytest.mark.parametrize("flights", [0, -3, 10**6])
def test_a_number_of_flights_that_nobody_flies_is_refused(project_root: Path, flights: int) -> None:
    with pytest.raises(UserError, match="between 1 and"):
        plan_cards([project_root / "config" / "studies" / "paper_table11.yaml"], flights, 1)


def test_only_a_page_is_written(project_root: Path, tmp_path: Path) -> None:
    cards = plan_cards([project_root / "config" / "studies" / "paper_table11.yaml"], 6, 1)
    with pytest.raises(UserError, match="ends with"):
        write_cards(cards, tmp_path / "cards.doc")
    write_cards(cards, tmp_path / "cards.html")
    assert (tmp_path / "cards.html").read_text(encoding="utf-8") == cards_page(cards)
