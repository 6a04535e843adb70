"""Steps on the page: numbered, escaped, with their command."""

from fusetune.report.sections.next_steps_section import _power_table, _power_text, steps_list


def test_steps_are_numbered_and_escaped_with_their_command() -> None:
    steps = [
        {"kind": "fly", "text": "Gain 10 % <b>", "command": ""},
        {"kind": "study", "text": "Run.", "command": "cp a b && c"},
    ]
    assert steps_list(steps) == (
        '<ol class="steps"><li>Gain 10&nbsp;% &lt;b&gt;</li><li>Run.<br><code>cp a b &amp;&amp; c</code></li></ol>'
    )


def test_power_is_told_for_flights_as_they_are_and_longer() -> None:
    def curve(times: float, needed: int | None) -> dict[str, object]:
        return {"gain_percent": 5.0, "times_longer": times, "needed": needed}

    power = {
        "flights": 7, "minutes": 0.57, "within_share": 0.6, "chance_asked_for": 0.8, "next_minutes": 3.0,
        "more": {"5": 0}, "curves": [curve(1.0, None), curve(5.2, 12)],
    }  # fmt: skip
    page = _power_table(power)
    assert "flights of 0.6 min" in page
    assert "flights of 3 min" in page
    assert "more than 30" in page
    assert ">12<" in page
    assert ">none<" in page
    assert "60 %: longer flights help." in _power_text(power)
    assert "rough" not in _power_text(power)
    assert _power_text(power | {"flights": 3, "within_share": None}).endswith(
        "bring. From so few flights this is rough."
    )
