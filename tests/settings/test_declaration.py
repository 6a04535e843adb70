"""What follows from the declaration of settings: schema, messages, and the dataclass that is built."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.errors import UserError
from fusetune.settings.checking import checked
from fusetune.settings.declaration import built, declared, required, section, setting
from fusetune.settings.schema import schema_of


@dataclass(frozen=True)
class Wing:
    """What carries.

    More of it.
    """

    span_m: float = setting(2.0, "from tip to tip", unit="m", above=0, high=60)
    flaps: bool = setting(False, "whether there are flaps")
    twist_deg: tuple[float, float] = setting((1.0, -1.0), "root and tip", unit="°", low=-10, high=10)

    def problems(self) -> Iterator[str]:
        """A tip that stalls first."""
        if self.twist_deg[1] > self.twist_deg[0]:
            yield f"twist_deg is {list(self.twist_deg)}; expected less at the tip"


@dataclass(frozen=True)
class Aircraft:
    """What flies."""

    name: str = required("what it is called", pattern="^[a-z]+$")
    first_flight: datetime.date = required("a day", pattern="^[0-9-]{10}$")
    wing: Wing = section(Wing)
    engines: int = setting(1, "how many engines", low=0, high=8)
    tail: Literal["T", "V"] = setting("T", "form of the tail")
    home: str | None = setting(None, "where it stands; empty: outside")
    loads: tuple[Wing, ...] = setting((), "wings it carries for others")
    weights: Mapping[str, float] = setting({"crew": 80.0}, "by what it is", unit="kg", low=0, choices=("crew", "fuel"))
    painted: bool = False


GIVEN: dict[str, Any] = {"name": "a", "first_flight": "1903-12-17"}


def message_of(values: Mapping[str, Any]) -> str:
    with pytest.raises(UserError) as error:
        checked(Aircraft, {**GIVEN, **values}, "a.yaml")
    return str(error.value)


def test_the_schema_says_what_is_declared() -> None:
    schema = schema_of(Aircraft)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["required"] == ["name", "first_flight"]
    properties = schema["properties"]
    assert list(properties) == [one.name for one in declared(Aircraft)] == [*asdict(aircraft())][:-1]
    wing = properties["wing"]
    assert wing["description"] == "What carries"
    assert wing["properties"]["span_m"] == {
        "type": "number",
        "exclusiveMinimum": 0,
        "maximum": 60,
        "default": 2.0,
        "description": "from tip to tip [m]",
    }
    assert properties["home"]["type"] == ["string", "null"]
    assert properties["tail"]["enum"] == ["T", "V"]
    assert properties["weights"]["additionalProperties"] == {"type": "number", "minimum": 0}
    twist = wing["properties"]["twist_deg"]
    assert (twist["minItems"], twist["maxItems"], twist["items"]["minimum"], twist["default"]) == (2, 2, -10, [1, -1])


def aircraft() -> Aircraft:
    return checked(Aircraft, GIVEN, "a.yaml")


def test_values_get_the_type_of_their_field() -> None:
    values = {"wing": {"span_m": 3, "twist_deg": [2, 1]}, "loads": [{"span_m": 4}], "weights": {"fuel": 7}}
    found = checked(Aircraft, GIVEN | values, "a.yaml")
    assert found == Aircraft(
        "a",
        datetime.date(1903, 12, 17),
        Wing(3.0, twist_deg=(2.0, 1.0)),
        loads=(Wing(4.0),),
        weights={"fuel": 7.0},
    )
    assert [type(value) for value in (found.wing.span_m, found.wing.twist_deg[0], found.weights["fuel"])] == [float] * 3
    assert aircraft().weights is not aircraft().weights


@pytest.mark.parametrize(
    ("values", "part"),
    [
        ({"engine": 2}, "unknown key 'engine' (did you mean 'engines'?); expected one of name, first_flight, wing"),
        ({"painted": True}, "unknown key 'painted'"),
        ({"name": "B"}, "name is 'B'; expected a text of the form ^[a-z]+$ – what it is called"),
        ({"name": "a\n"}, "name is 'a\\n'"),
        ({"engines": 2.0}, "engines is 2.0; expected a whole number between 0 and 8 – how many engines"),
        ({"engines": True}, "engines is true; expected a whole number"),
        ({"wing": {"span_m": 0}}, "wing.span_m is 0; expected a number greater than 0, of at most 60 – from tip"),
        ({"wing": {"span_m": float("nan")}}, "wing.span_m is nan; expected a finite number"),
        ({"wing": {"flaps": 1}}, "wing.flaps is 1; expected true or false – whether there are flaps"),
        ({"wing": {"twist_deg": [0, 11]}}, "wing.twist_deg[1] is 11; expected a number between -10 and 10"),
        ({"wing": {"twist_deg": [0, 1]}}, "wing.twist_deg is [0.0, 1.0]; expected less at the tip"),
        ({"tail": "X"}, "tail is 'X'; expected one of 'T', 'V'"),
        ({"loads": [{"span": 1}]}, "loads[0]: unknown key 'span' (did you mean 'span_m'?)"),
        ({"weights": {"cargo": 1}}, "weights: the key 'cargo' is not a valid name; expected one of 'crew', 'fuel'"),
    ],
)
def test_what_cannot_be_meant_is_told(values: dict[str, Any], part: str) -> None:
    assert part in message_of(values)
    assert message_of(values).startswith("a.yaml: ")


def test_what_is_missing_is_told() -> None:
    with pytest.raises(UserError, match="'first_flight' is missing; expected a text"):
        checked(Aircraft, {"name": "a"}, "a.yaml")


@given(
    span_m=st.floats(0, 60, exclude_min=True),
    twist=st.lists(st.floats(-10, 10), min_size=2, max_size=2),
    engines=st.integers(0, 8),
    home=st.none() | st.text(),
)
def test_what_is_built_can_be_given_again(span_m: float, twist: list[float], engines: int, home: str | None) -> None:
    wing = Wing(span_m, twist_deg=(max(twist), min(twist)))
    made = replace(aircraft(), wing=wing, engines=engines, home=home)
    given_again = {one.name: asdict(made)[one.name] for one in declared(Aircraft)}
    assert built(Aircraft, given_again | {"first_flight": "1903-12-17"}) == made
    written = given_again | {"first_flight": "1903-12-17", "loads": []}
    written["wing"] = asdict(wing) | {"twist_deg": list(wing.twist_deg)}
    assert checked(Aircraft, written, "a.yaml") == made


@given(st.floats(allow_nan=False).filter(lambda value: not 0 < value <= 60))
def test_no_number_outside_the_range_is_taken(span_m: float) -> None:
    assert "wing.span_m is" in message_of({"wing": {"span_m": span_m}})
