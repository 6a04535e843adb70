"""The diagnosis as a whole: order, what is explained away, unknown; and the replay that bears a claim out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.analyze.diagnosis.made_signs import AIR, signs

from fusetune.analyze.diagnosis import diagnose as whole
from fusetune.analyze.diagnosis.causes.claim import MOST_SURE, confidence
from fusetune.analyze.diagnosis.causes.registry import CAUSES
from fusetune.analyze.diagnosis.diagnose import UNKNOWN, diagnose, in_order
from fusetune.analyze.diagnosis.diagnosed_logs import AS_FLOWN
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.experiments import trial_of, tried
from fusetune.analyze.diagnosis.explained_away import MAKES, explained_away
from fusetune.analyze.diagnosis.innovation_signs import LARGEST, ratios_of
from fusetune.analyze.diagnosis.reliability import LARGEST as SUREST
from fusetune.analyze.diagnosis.reliability import calibrated, said_of
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.reader import read_ulog


def claim(id: str, explains: float = 1.0, sure: float = 0.9, **others: object) -> Diagnosis:
    one = Diagnosis(id, id, "warning", sure, explains, *AIR[0], (Sign("seen", 2.0, 1.0),), "mend it", "made")
    return replace(one, **others)  # type: ignore[arg-type]


def test_what_explains_most_as_far_as_it_is_sure_stands_first_and_notes_last() -> None:
    made = [claim("b", 5.0, severity="note"), claim("c", 2.0, 0.4), claim("a", 1.0, 0.9), claim("d", 3.0, 0.9)]
    assert [one.id for one in in_order(made)] == ["d", "a", "c", "b"]


def test_a_consequence_goes_with_its_cause_and_stays_without() -> None:
    loss, jammed = claim("gnss_loss"), claim("gnss_interference")
    assert [one.id for one in explained_away([loss, jammed])] == ["gnss_interference"]
    assert [one.id for one in explained_away([loss])] == ["gnss_loss"]


def test_a_noise_of_readings_that_nothing_else_enters_follows_from_nothing() -> None:
    gaps = claim("imu_gaps")
    of_gnss, of_barometer = (claim("noise_claim", values={f"EKF2_{name}_NOISE": 0.1}) for name in ("GPS_V", "BARO"))
    assert [one.id for one in explained_away([gaps, of_gnss])] == ["imu_gaps"]
    assert [one.id for one in explained_away([gaps, of_barometer])] == ["imu_gaps", "noise_claim"]


def test_what_happened_at_another_time_is_no_consequence() -> None:
    early = claim("gnss_interference", stop_us=20_000_000)
    late = claim("gnss_loss", start_us=40_000_000)
    assert {one.id for one in explained_away([early, late])} == {"gnss_interference", "gnss_loss"}


def test_all_that_explains_and_is_explained_is_a_cause() -> None:
    assert set(MAKES) | {other for made in MAKES.values() for other in made} <= set(CAUSES)


def test_ratios_are_cut_before_they_are_averaged() -> None:
    time = np.arange(AIR[0][0], AIR[0][0] + 100_000 * 20, 100_000)
    ratio = np.r_[np.full(18, 0.2), 0.8, 1e6]
    one = ratios_of(time, ratio, AIR, 0, "replay")
    # by hand: (18 · 0.2 + 0.8 + 10) / 20, and (0.3 + 9.5) / 20 of what is beyond a half
    assert one is not None
    assert one.mean == pytest.approx(0.72)
    assert one.excess == pytest.approx(0.49)
    assert one.above_half == pytest.approx(0.1)
    assert one.above_gate == pytest.approx(0.05)
    assert one.worst == 1e6
    assert LARGEST == 10.0
    assert one.off == (int(time[-1]), int(time[-1]) + 1)


def test_bad_innovations_without_a_cause_are_told_as_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.arange(AIR[0][0], AIR[0][1], 200_000)
    bad = ratios_of(time, np.where(np.arange(time.size) % 3, 0.1, 3.0), AIR, 0, "replay")
    monkeypatch.setattr(whole, "Signs", lambda *_: signs(ratios={"gnss_vel": bad}))
    found = diagnose(ObservedFlight(Flight("made")))
    assert [one.id for one in found] == [UNKNOWN]
    assert found[0].signs[0].figure == pytest.approx(1 / 3, abs=0.01)
    monkeypatch.setattr(whole, "Signs", lambda *_: signs())
    assert diagnose(ObservedFlight(Flight("made"))) == ()


def test_a_figure_at_its_level_is_a_toss_of_a_coin_and_none_is_certain() -> None:
    assert confidence(1.0, 1.0) == pytest.approx(0.5)
    assert 0.9 < confidence(4.0, 1.0) < confidence(1e9, 1.0) <= MOST_SURE


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_share_that_is_right_grows_with_what_signs_say(one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert 0.0 <= calibrated(low) <= calibrated(high) < 1.0


@given(st.floats(0.05, 0.85))
def test_what_signs_said_is_read_off_what_is_told(said: float) -> None:
    assert calibrated(said) < SUREST
    assert said_of(calibrated(said)) == pytest.approx(said, abs=0.01)


def test_what_is_told_is_the_share_that_is_right(monkeypatch: pytest.MonkeyPatch) -> None:
    made = claim("vibration", sure=0.6)
    monkeypatch.setattr(whole, "Signs", lambda *_: signs())
    monkeypatch.setattr(whole, "CAUSES", {"vibration": lambda _: made})
    (found,) = diagnose(ObservedFlight(Flight("made")))
    # of 30 diagnoses that signs made so sure of 24 were right
    assert found.confidence == pytest.approx(24 / 30, abs=0.03)


@pytest.fixture(scope="module")
def told_wrong(survey_flight: Flight) -> Flight:
    """The simulated survey with PX4 told 120 ms more than the receiver needs, and gates at which that shows."""
    parameters = replace(survey_flight.parameters, initial={**survey_flight.parameters.initial})
    parameters.initial["EKF2_GPS_DELAY"] = float(parameters.initial.get("EKF2_GPS_DELAY", 110.0)) + 120.0
    parameters.initial |= {"EKF2_GPS_V_GATE": 1.5, "EKF2_GPS_P_GATE": 1.5}
    return replace(survey_flight, parameters=parameters)


def test_a_wrong_delay_is_found_on_a_simulated_flight_and_borne_out_by_a_replay(told_wrong: Flight) -> None:
    told = float(told_wrong.parameters.initial["EKF2_GPS_DELAY"])
    found = diagnose(ObservedFlight(told_wrong, AS_FLOWN))
    assert found
    assert found[0].id == "gnss_delay"
    assert found[0].values["EKF2_GPS_DELAY"] == pytest.approx(told - 120.0, abs=15.0)
    trial = found[0].trial
    assert trial is not None
    assert trial.outcome == "better"
    assert trial.after < trial.before
    assert trial.words.startswith("the replay with EKF2_GPS_DELAY")
    assert not any("replay" in sign.words for sign in found[0].signs)


def test_an_experiment_that_contradicts_lets_a_claim_fall(told_wrong: Flight, survey_flight: Flight) -> None:
    worse = claim("gnss_lever_arm", sure=0.55, values={"EKF2_GPS_POS_X": 2.0})
    assert tried(worse, Signs(ObservedFlight(survey_flight, AS_FLOWN))) is None
    right = claim("gnss_delay", sure=0.55, values={"EKF2_GPS_DELAY": 110.0})
    borne_out = tried(right, Signs(ObservedFlight(told_wrong, AS_FLOWN)))
    assert borne_out is not None
    assert borne_out.confidence > 0.7


@pytest.mark.parametrize(
    ("before", "after", "outcome", "words"),
    [
        (0.3, 0.2, "better", "is better: mean test ratio of gnss_vel 0.3 before, 0.2 after"),
        (0.3, 0.28, "no better", "is no better: mean test ratio of gnss_vel 0.3 before, 0.28 after"),
        (0.1, 0.2, "worse", "is worse: mean test ratio of gnss_vel 0.1 before, 0.2 after"),
        # an octorotor whose compass the filter had given up: nothing changes, and there was nothing to mend
        (0.00277, 0.00277, "tells nothing", "is the same, so the filter made no use of it"),
        # 17 % less of a ratio that is a sixth of what noise alone makes is no evidence
        (0.006, 0.005, "tells nothing", "tells nothing, these sources are fine with it as well"),
    ],
)
def test_what_a_replay_shows_is_told_plainly(before: float, after: float, outcome: str, words: str) -> None:
    trial = trial_of("without it", "gnss_vel", before, after)
    assert trial.outcome == outcome
    assert words in trial.words


def test_what_mends_one_source_and_spoils_another_bears_nothing_out() -> None:
    trial = trial_of("without it", "gnss_vel, mag", 1.2, 0.4, ["gnss_vel"])
    assert trial.outcome == "no better"
    assert "but worse for gnss_vel" in trial.words


def test_the_experiment_turns_the_compass_back_as_the_sign_says(shared_logs: Path) -> None:
    # 13 s in the air are too short for a heading by GNSS: the sign goes by tilt alone
    log = read_ulog(shared_logs / "erdemarslan380__sitl_windy.ulg")
    found = diagnose(ObservedFlight(log, AS_FLOWN))[0]
    assert found.id == "magnetometer_rotated"
    assert found.trial is not None
    assert found.trial.outcome == "better"
    assert found.trial.after < 0.1 * found.trial.before


def test_without_experiments_nothing_is_replayed_twice(told_wrong: Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    replayed = _counted(monkeypatch)
    found = diagnose(ObservedFlight(told_wrong, AS_FLOWN), experiments=0)
    assert found[0].id == "gnss_delay"
    assert replayed() == 0
    diagnose(ObservedFlight(told_wrong, AS_FLOWN))
    assert 1 <= replayed() <= 2


def _counted(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    from fusetune.analyze.diagnosis import experiments

    calls: list[str] = []
    replay_set = experiments.replay_set

    def counted(*given: object) -> object:
        calls.append("replayed")
        return replay_set(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(experiments, "replay_set", counted)
    return lambda: len(calls)


REAL = {
    "PX4__ekf_failure": ("accelerometer_clipping", "fail"),
    "SkyRats__log_28_2021-7-9-16-23-30": ("magnetic_disturbance", "fail"),
    "SkyRats__log_29_2021-7-9-16-25-06": ("magnetic_disturbance", "fail"),
    "Chainplain__log_9_2024-10-14-15-00-06": ("accelerometer_clipping", "warning"),
    "PX4__gps_interference": ("gnss_loss", "fail"),
    "Auterion__quadrotor_local": ("gnss_loss", "fail"),
    "erdemarslan380__sitl_max_80": ("magnetometer_rotated", "fail"),
    "erdemarslan380__sitl_windy": ("magnetometer_rotated", "fail"),
    "YevheniiKovryzhenko__log_16_2024-8-8-11-32-18": ("imu_gaps", "warning"),
    "mengchaoheng__test3": ("imu_gaps", "warning"),
}
"""What the folder's own README says of these flights."""
ALSO = {"Chainplain__log_9_2024-10-14-15-00-06": "instance_whipsaw", "FSYR-H__log_61_2024-2-6-16-27-02": "vibration"}
SOUND = (
    "SkyRats__log_7_",
    "SkyRats__log_8_",
    "SkyRats__log_9_",
    "SkyRats__log_10_",
    "SkyRats__log_13_",
    "SkyRats__log_16_",
    "SkyRats__log_17_",
    "JAParedes__TestFlight1",
    "Parham-Oveissi__log_40_",
    "SkyRats__log_3_",
)


def of_log(file: Path) -> tuple[Diagnosis, ...]:
    return diagnose(ObservedFlight(read_ulog(file), AS_FLOWN), experiments=0)


@pytest.mark.parametrize("log", sorted(REAL))
def test_real_flights_are_diagnosed_as_they_are_known(shared_logs: Path, log: str) -> None:
    found = of_log(shared_logs / f"{log}.ulg")
    assert (found[0].id, found[0].severity) == REAL[log]


@pytest.mark.parametrize("log", sorted(ALSO))
def test_more_than_one_cause_may_hold(shared_logs: Path, log: str) -> None:
    assert ALSO[log] in [one.id for one in of_log(shared_logs / f"{log}.ulg")]


TRUE_OF_SOUND = {"gnss_delay"}
"""The receiver of seven flights of one quadrotor is 144 to 172 ms late on each, together 153 to 172, told 110."""


@pytest.mark.parametrize("log", [*SOUND, "synthetic__fw_airspeed"])
def test_what_is_told_of_sound_real_flights_is_true_and_no_failure(shared_logs: Path, log: str) -> None:
    (file,) = shared_logs.glob(f"{log}*.ulg")
    found = of_log(file)
    assert [one.id for one in found if one.severity == "fail"] == []
    # the compass of this octorotor is as bad as on its flights 28 and 29
    if log != "SkyRats__log_3_":
        assert {one.id for one in found if one.severity == "warning"} <= TRUE_OF_SOUND
