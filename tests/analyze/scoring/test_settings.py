"""Settings are checked with messages that say what was expected."""

import pytest

from fusetune.analyze.scoring.scoring_settings import ScoringSettings
from fusetune.errors import UserError


def test_missing_section_means_defaults() -> None:
    assert ScoringSettings.from_mapping(None) == ScoringSettings()


def test_whole_numbers_are_fine() -> None:
    assert ScoringSettings.from_mapping({"settle_s": 3}).settle_s == 3.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"setle_s": 1.0}, "scoring.setle_s is not a setting"),
        ({"settle_s": "long"}, "scoring.settle_s is 'long', expected a value of type float"),
        ({"settle_s": True}, "expected a value of type float"),
        ({"block_s": 0.5}, "scoring.block_s is 0.5, outside 2.0 to 60.0 s"),
        ({"block_s": float("nan")}, "outside"),
    ],
)
def test_bad_settings_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(UserError, match=message.replace(".", r"\.")):
        ScoringSettings.from_mapping(values, file="config/config.yaml")
