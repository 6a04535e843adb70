"""A check declares itself, and its findings bear what it declared."""

from __future__ import annotations

from fusetune.check import check
from fusetune.finding import Finding


@check(topics=("vehicle_gps_position",), thresholds=("high_jump_m",), unit="m")
def jumps(steps_m: list[float]) -> list[Finding]:
    """Steps of the position that no vehicle makes.

    What more there is to say does not belong to what it looks at.
    """
    found = [
        jumps.warned(f"{step:g} m", "Look at the sky", step, 5.0, start_us=second, stop_us=second + 1)
        for second, step in enumerate(steps_m)
        if step > 5.0
    ]
    return found or [jumps.passed("none", max(steps_m, default=0.0), 5.0)]


@check(unit="m")
def present(steps_m: list[float]) -> Finding:
    """Whether there are any."""
    if not steps_m:
        return present.does_not_apply("no steps")
    return present.failed("a share", "Fly again", 0.5, unit="", evidence={"steps": len(steps_m)})


def test_a_check_says_what_it_is_and_needs() -> None:
    assert (jumps.id, jumps.looks_at) == ("jumps", "Steps of the position that no vehicle makes.")
    assert (jumps.topics, jumps.thresholds, jumps.unit) == (("vehicle_gps_position",), ("high_jump_m",), "m")


def test_a_check_may_find_several_things_at_several_times() -> None:
    first, second = jumps.findings([1.0, 7.0, 9.0])
    assert first == Finding("jumps", "warning", "7 m", "Look at the sky", 7.0, 5.0, "m", 1, 2)
    assert (second.figure, second.start_us) == (9.0, 2)
    assert jumps.findings([1.0]) == (Finding("jumps", "pass", "none", "", 1.0, 5.0, "m"),)


def test_a_figure_may_have_another_unit_and_what_has_none_needs_none() -> None:
    assert present.findings([1.0]) == (Finding("present", "fail", "a share", "Fly again", 0.5, evidence={"steps": 1}),)
    assert present.findings([]) == (Finding("present", "does-not-apply", "no steps"),)
