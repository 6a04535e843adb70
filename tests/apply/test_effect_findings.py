"""Single effects that are measured otherwise than PX4 is told, as findings of the decision."""

from __future__ import annotations

from tests.apply.test_choice import one

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.joined_effects import JoinedEffects, join_effects
from fusetune.apply.choice import Choice
from fusetune.apply.effect_findings import effect_findings

KEEP = Choice("keep", "present", one("antenna_mended", 0.0, 0.1), None, False, None)
CHANGE = Choice("change", "antenna_mended", one("antenna_mended", -0.1, 0.01), None, False, None)


def joined(name: str, value: float, flights: int = 3, effect: str = "gnss_antenna") -> JoinedEffects:
    found = Effect(effect, (Estimate(name, "m", 0.0, value, value - 0.02, value + 0.02, 0.01, 100),))
    return join_effects({str(number): [found] for number in range(flights)})


def test_a_measured_value_is_told_with_what_became_of_its_set() -> None:
    (found,) = effect_findings(joined("EKF2_GPS_POS_X", -0.3), KEEP, ["present", "antenna_mended"])
    assert found.id == "effect.gnss_antenna"
    assert found.found.startswith("EKF2_GPS_POS_X is measured as −0.3 m (95 %: −0.3")
    assert found.remedy == (
        "The set antenna_mended was compared with EKF2_GPS_POS_X = -0.3; it was not chosen, so nothing is set"
    )
    (found,) = effect_findings(joined("EKF2_GPS_POS_X", -0.3), CHANGE, ["present", "antenna_mended"])
    assert found.remedy == "Set by the choice: EKF2_GPS_POS_X to -0.3"


def test_what_no_set_can_try_is_to_be_set_and_flown() -> None:
    (found,) = effect_findings(joined("SENS_FLOW_SCALE", 1.3, effect="optical_flow"), KEEP, ["present"])
    assert found.remedy.startswith("Set SENS_FLOW_SCALE to 1.3 and fly again")


def test_one_flight_is_said_to_be_one_and_what_is_as_told_is_not_said() -> None:
    (found,) = effect_findings(joined("EKF2_GPS_POS_X", -0.3, flights=1), KEEP, ["present"])
    assert "as far as one flight can tell" in found.found
    assert found.remedy == "Fly and add another flight of the same kind"
    assert effect_findings(joined("EKF2_GPS_POS_X", 0.01), KEEP, ["present"]) == ()
    assert effect_findings(joined("motor_field_x", 0.3, effect="motor_magnetic_field"), KEEP, ["present"]) == ()
