"""Settings of a command line mean what they would in a file, by whichever of the ways they are written."""

from __future__ import annotations

import pytest
from snakemake.cli import parse_config

from fusetune.configuration import Configuration, read_configuration
from fusetune.errors import UserError
from fusetune.settings.given_values import plain_entries

MEANT = {
    "minimum_flights": 3,
    "sources": {"mag": 0.5, "baro_hgt": 1},
    "withheld_sources": {"gnss_vel.z": 2.0},
    "smoothed_axes": {"x": 1e-3},
    "only_classes": ["turn", "hover"],
    "multiplicity": "sign_flips",
}


@pytest.mark.parametrize(
    "entries",
    [
        ["decision={minimum_flights: 3, sources: {mag: 0.5, baro_hgt: 1}, withheld_sources: {gnss_vel.z: 2.0}, "
         "smoothed_axes: {x: 1e-3}, only_classes: [turn, hover], multiplicity: sign_flips}"],
        ["decision.minimum_flights=3", "decision.sources={mag: 0.5, baro_hgt: 1}", "decision.smoothed_axes.x=1e-3",
         "decision.withheld_sources.gnss_vel.z=2.0", "decision.only_classes=[turn, hover]",
         "decision.multiplicity=sign_flips"],
        ["decision={minimum_flights: 7}", "decision.minimum_flights=3", "decision={sources: {mag: 0.5}}",
         "decision.sources.baro_hgt=1", "decision={withheld_sources: {gnss_vel.z: 2.0}, smoothed_axes: {x: 1e-3}}",
         "decision={only_classes: [turn, hover], multiplicity: sign_flips}"],
    ],
    ids=["a section", "its keys", "both"],
)  # fmt: skip
def test_sections_and_keys_of_them_are_one_configuration(entries: list[str]) -> None:
    given = read_configuration([], parse_config(plain_entries(entries)))
    assert given == read_configuration([], {"decision": MEANT})
    assert given.decision.minimum_flights == 3
    assert given.decision.sources["baro_hgt"] == 1


def test_a_text_stays_one_and_an_empty_value_is_none() -> None:
    entries = [
        "demonstration.study=12",
        "present_flight=",
        "decision.only_classes=[]",
        "delays.mend=no",
    ]
    given = read_configuration([], parse_config(plain_entries(entries)))
    assert (given.demonstration.study, given.present_flight, given.delays.mend) == ("12", None, False)
    assert given.decision.only_classes == ()
    assert read_configuration([], {}) == Configuration().located


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("decision.minimum_flihgts=3", "decision: unknown key 'minimum_flihgts' (did you mean 'minimum_flights'?)"),
        ("decison.minimum_flights=3", "unknown key 'decison' (did you mean 'decision'?)"),
        ("decision.minimum_flights=many", "decision.minimum_flights is 'many'; expected a whole number between"),
        ("decision.minimum_flights.x=3", "decision.minimum_flights is a mapping with the keys x; expected a whole"),
        ("decision={minimum_flights: 0}", "decision.minimum_flights is 0; expected a whole number between 1 and 1000"),
        ("decision=3", "decision is 3; expected a mapping (keys and values)"),
        ("seed.x=3", "seed is a mapping with the keys x; expected a whole number"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_the_key(entry: str, told: str) -> None:
    with pytest.raises(UserError) as error:
        read_configuration([], parse_config(plain_entries([entry])))
    assert str(error.value).startswith(f"--config: {told}")


@pytest.mark.parametrize("entry", ["decision.minimum_flights", ".x=3", "decision.=3", "=3"])
def test_what_is_no_entry_is_told(entry: str) -> None:
    with pytest.raises(UserError, match="is not KEY=VALUE"):
        plain_entries([entry])
