"""Single effects that are measured otherwise than PX4 is told, as findings of the decision."""

from __future__ import annotations

from tests.apply.test_choice import one

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.joined_effects import JoinedEffects, join_effects
from fusetune.apply.choice import Choice
from fusetune.apply.effect_findings import effect_findings
from fusetune.apply.ranking import RankedSet
from fusetune.apply.settings import DecisionSettings

SETTINGS = DecisionSettings()
PRESENT = one("present", 0.0, 0.0, is_present=True)
TRIED = one("antenna_mended", -0.05, 0.1)
KEEP = Choice("keep", "present", one("antenna_mended", 0.0, 0.1), None, False, None)
CHANGE = Choice("change", "antenna_mended", one("antenna_mended", -0.1, 0.01), None, False, None)


def joined(name: str, value: float, flights: int = 3, effect: str = "gnss_antenna") -> JoinedEffects:
    found = Effect(effect, (Estimate(name, "m", 0.0, value, value - 0.02, value + 0.02, 0.01, 100),))
    return join_effects({str(number): [found] for number in range(flights)})


def test_a_measured_value_is_told_with_what_became_of_its_set() -> None:
    (found,) = effect_findings(joined("EKF2_GPS_POS_X", -0.3), KEEP, [PRESENT, TRIED], (), SETTINGS)
    assert found.id == "effect.gnss_antenna"
    assert found.found.startswith("EKF2_GPS_POS_X is measured as −0.3 m (95 %: −0.3")
    assert found.remedy == (
        "The set antenna_mended was compared with EKF2_GPS_POS_X = -0.3; it was not chosen, so nothing is set"
    )
    (found,) = effect_findings(joined("EKF2_GPS_POS_X", -0.3), CHANGE, [PRESENT, TRIED], ["EKF2_GPS_POS_X"], SETTINGS)
    assert found.remedy == "Set by the choice: EKF2_GPS_POS_X to -0.3"


def test_what_no_set_can_try_is_to_be_set_and_flown() -> None:
    (found,) = effect_findings(joined("SENS_FLOW_SCALE", 1.3, effect="optical_flow"), KEEP, [PRESENT], (), SETTINGS)
    assert found.remedy.startswith("Set SENS_FLOW_SCALE to 1.3 and fly again")


def test_one_flight_is_said_to_be_one_and_what_is_as_told_is_not_said() -> None:
    (found,) = effect_findings(joined("EKF2_GPS_POS_X", -0.3, flights=1), KEEP, [PRESENT], (), SETTINGS)
    assert "as far as one flight can tell" in found.found
    assert found.remedy == "Fly and add another flight of the same kind"
    assert effect_findings(joined("EKF2_GPS_POS_X", 0.01), KEEP, [PRESENT], (), SETTINGS) == ()
    assert (
        effect_findings(joined("motor_field_x", 0.3, effect="motor_magnetic_field"), KEEP, [PRESENT], (), SETTINGS)
        == ()
    )


def test_what_another_choice_leaves_of_it_is_told() -> None:
    """Beside what a search found: better as well, set by that too, or of no use to the filter as it flies."""
    found = Choice("change", "found", one("found", -0.3, -0.2), one("found", -0.3, -0.2), False, None)

    def remedy(tried: RankedSet, *changed: str) -> str:
        (finding,) = effect_findings(joined("EKF2_GPS_POS_X", -0.3), found, [PRESENT, tried], changed, SETTINGS)
        return finding.remedy

    better = one("antenna_mended", -0.2, -0.1)
    assert remedy(better) == (
        "The set antenna_mended with EKF2_GPS_POS_X = -0.3 is better than what flies now, too, and found is to be "
        "preferred: set that, fly, and compare again"
    )
    assert remedy(better, "EKF2_GPS_POS_X").startswith("Set by the choice, found, to values of its own; measured: ")
    same = one("antenna_mended", 0.0, 0.0, equal_to_present=True)
    assert "does the same as what flies now" in remedy(same)
