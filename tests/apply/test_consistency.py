"""What PX4 is told of the sources' noise against what flights show, on figures of which the answer is known by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.consistency import (
    ESTIMATOR_ERROR,
    PRIOR_FREEDOM,
    PRIOR_SCATTER,
    SourceNoise,
    consistency_candidates,
    consistency_findings,
    proposed_value,
    sentence_of_largest,
    source_noises,
)
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.aid_sources import AID_SOURCES, AXES
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

SETTINGS = DecisionSettings()
NOW = {"EKF2_GPS_V_NOISE": 0.3, "EKF2_GPS_P_NOISE": 0.5, "EKF2_BARO_NOISE": 3.5, "EKF2_EAS_NOISE": 1.4}
Figures = Mapping[str, float]


def table(flights: Sequence[Mapping[str, Figures]]) -> pa.Table:
    """Figures of the present set, the same on each axis: for each flight source → metric → value."""
    rows = [
        ("flight_" + str(number), "present", source, axis, metric, value, math.nan, math.nan, 100.0)
        for number, sources in enumerate(flights)
        for source, figures in sources.items()
        for axis in AXES[: AID_SOURCES[source].axes]
        for metric, value in figures.items()
    ]
    return pa.Table.from_pylist(
        [dict(zip(METRICS_SCHEMA.names, row, strict=True)) for row in rows], schema=METRICS_SCHEMA
    )


def white(told: float, noise: float, innovation: float | None = None) -> Figures:
    """A source with white errors."""
    return {
        "told_noise": told,
        "rms_innovation": noise if innovation is None else innovation,
        "white_noise": noise,
        "correlated_noise": 0.0,
        "equivalent_noise": noise,
        "error_correlation_s": 1.0,
    }


def wandering(told: float, noise: float, wander: float, equivalent: float, time_s: float) -> Figures:
    return white(told, noise) | {
        "correlated_noise": wander,
        "equivalent_noise": equivalent,
        "error_correlation_s": time_s,
    }


def noise_of(flights: Sequence[Mapping[str, Figures]], source: str) -> SourceNoise:
    found = source_noises(table(flights), "present", NOW, SETTINGS)
    return next(one for one in found if one.source == source)


def test_the_size_is_the_geometric_mean_and_the_interval_that_of_t_with_a_prior() -> None:
    found = noise_of([{"gnss_vel": white(0.3, 0.05)}, {"gnss_vel": white(0.3, 0.2)}], "gnss_vel")
    assert (found.told, found.size) == (pytest.approx(0.3), pytest.approx(0.1))  # √(0.05 · 0.2)
    # logarithms lie ± ln 2 about their mean; the prior counts as four flights more
    squares = 2.0 * math.log(2.0) ** 2 + PRIOR_FREEDOM * PRIOR_SCATTER**2
    freedom = PRIOR_FREEDOM + 1.0
    reach = stats.t.ppf(0.975, freedom) * math.sqrt(squares / freedom / 2.0) + ESTIMATOR_ERROR
    assert found.upper == pytest.approx(0.1 * math.exp(reach))
    assert found.lower == pytest.approx(0.1 * math.exp(-reach))


def test_a_single_flight_has_an_interval() -> None:
    found = noise_of([{"gnss_vel": white(0.3, 0.1)}], "gnss_vel")
    reach = stats.t.ppf(0.975, 4.0) * 0.25 + ESTIMATOR_ERROR
    assert (found.lower, found.upper) == (
        pytest.approx(0.1 * math.exp(-reach)),
        pytest.approx(0.1 * math.exp(reach)),
    )


def test_the_interval_goes_from_the_white_noise_to_that_with_what_wanders() -> None:
    flights = [{"gnss_vel": wandering(0.3, 0.03, 0.04, 0.2, 2.0)}] * 8
    found = noise_of(flights, "gnss_vel")
    assert found.size == pytest.approx(0.05)  # 3-4-5
    reach = stats.t.ppf(0.975, 11.0) * math.sqrt(4.0 * 0.25**2 / 11.0 / 8.0) + ESTIMATOR_ERROR
    assert found.lower == pytest.approx(0.03 * math.exp(-reach))
    assert found.upper == pytest.approx(0.05 * math.exp(reach))
    assert found.wanders_s == 2.0


def test_of_a_noise_that_is_told_three_times_too_large_it_is_said_and_the_value_proposed() -> None:
    noises = source_noises(table([{"gnss_vel": white(0.3, 0.1)}] * 8), "present", NOW, SETTINGS)
    (finding,) = consistency_findings(noises, SETTINGS)
    assert finding.found.startswith(
        "PX4 is told that the GNSS velocity is 3 times worse than it is: 0.3 m/s, where 8 flights show 0.1 m/s (95% "
    )
    assert (finding.severity, finding.figure, finding.threshold) == ("note", pytest.approx(0.1), pytest.approx(0.15))
    assert finding.remedy == "Compare EKF2_GPS_V_NOISE = 0.1 in a study before flying it (now 0.3)"
    (candidate,) = consistency_candidates(noises, SETTINGS)
    assert (candidate.name, candidate.overrides) == ("measured_gps_v_noise", {"EKF2_GPS_V_NOISE": 0.1})
    assert sentence_of_largest([finding]) == f"Beside the choice of a set: {finding.found}."


@pytest.mark.parametrize("noise", [0.16, 0.3, 0.55])
def test_nothing_is_said_within_a_factor_of_two(noise: float) -> None:
    noises = source_noises(table([{"gnss_vel": white(0.3, noise)}] * 8), "present", NOW, SETTINGS)
    assert consistency_findings(noises, SETTINGS) == []
    assert consistency_candidates(noises, SETTINGS) == []
    assert sentence_of_largest([]) == ""


def test_nothing_is_said_of_what_one_flight_cannot_show() -> None:
    # a third, but a single flight may be off by more than the factor of 1.5 that is left
    noises = source_noises(table([{"gnss_vel": white(0.3, 0.1)}]), "present", NOW, SETTINGS)
    assert consistency_findings(noises, SETTINGS) == []


def test_a_noise_that_is_told_too_small_is_a_warning() -> None:
    noises = source_noises(table([{"gnss_vel": white(0.3, 0.9)}] * 8), "present", NOW, SETTINGS)
    (finding,) = consistency_findings(noises, SETTINGS)
    assert finding.severity == "warning"
    assert "is 3 times better than it is" in finding.found
    assert finding.evidence["proposed"] == 0.9


def test_of_an_error_that_wanders_no_lower_value_is_proposed() -> None:
    # small, but a filter that averages it as white would need three times what it is told
    noises = source_noises(table([{"baro_hgt": wandering(3.5, 0.1, 0.2, 10.0, 8.0)}] * 8), "present", NOW, SETTINGS)
    (finding,) = consistency_findings(noises, SETTINGS)
    assert "16 times worse" in finding.found  # 3.5 / √(0.1² + 0.2²)
    assert finding.remedy == (
        "Leave EKF2_BARO_NOISE as it is; part of its error wanders for some 8 s, and a filter, which takes it for "
        "white, may have to be told as much as 10 m"
    )
    assert consistency_candidates(noises, SETTINGS) == []


def test_below_what_the_receiver_reports_a_floor_changes_nothing() -> None:
    noises = source_noises(table([{"gnss_vel": white(0.5, 0.1)}] * 8), "present", NOW, SETTINGS)
    (finding,) = consistency_findings(noises, SETTINGS)
    assert finding.remedy == (
        "Lowering EKF2_GPS_V_NOISE changes nothing: what the sensor itself reports is larger, and rules"
    )
    assert consistency_candidates(noises, SETTINGS) == []
    # above it acts: the receiver says 0.5 and errs by 1.8
    noises = source_noises(table([{"gnss_vel": white(0.5, 1.8)}] * 8), "present", NOW, SETTINGS)
    (candidate,) = consistency_candidates(noises, SETTINGS)
    assert candidate.overrides == {"EKF2_GPS_V_NOISE": 1.8}


def test_a_parameter_that_two_sources_share_gets_the_larger_value() -> None:
    # heights take 1.5 times EKF2_GPS_P_NOISE: an error of 0.3 m is one of 0.2 in the parameter
    flights = [{"gnss_pos": white(0.5, 0.1), "gnss_hgt": white(0.75, 0.3)}] * 8
    noises = source_noises(table(flights), "present", NOW, SETTINGS)
    assert [one.rules for one in noises] == [True, True]
    (candidate,) = consistency_candidates(noises, SETTINGS)
    assert candidate.overrides == {"EKF2_GPS_P_NOISE": 0.2}


def test_flights_on_which_a_source_wanders_count_in_what_a_filter_wants() -> None:
    flights = [{"gnss_vel": white(0.3, 0.1)}] * 3 + [{"gnss_vel": wandering(0.3, 0.1, 0.05, 0.5, 2.0)}]
    found = noise_of(flights, "gnss_vel")
    assert found.wanted == pytest.approx(math.sqrt((3 * 0.1**2 + 0.5**2) / 4.0))
    assert found.wanders_s == 2.0


def test_a_noisier_source_of_the_same_parameter_keeps_its_value() -> None:
    flights = [{"gnss_pos": white(0.5, 0.1), "gnss_hgt": white(0.75, 0.7)}] * 8
    noises = source_noises(table(flights), "present", NOW, SETTINGS)
    (finding,) = consistency_findings(noises, SETTINGS)
    assert finding.remedy == "Leave EKF2_GPS_P_NOISE as it is: it is that of another source, too, which is noisier"


def test_a_proposed_value_stays_in_the_range_of_the_parameter() -> None:
    least = PARAMETERS["EKF2_GPS_V_NOISE"].minimum
    assert least is not None
    noises = source_noises(table([{"gnss_vel": white(0.3, 1e-4)}] * 8), "present", NOW, SETTINGS)
    assert proposed_value(noises[0], noises) == least


def test_of_a_source_without_errors_of_its_own_the_innovations_are_a_bound() -> None:
    flights = [{"airspeed": {"told_noise": 1.4, "rms_innovation": 0.2}}] * 5
    noises = source_noises(table(flights), "present", NOW, SETTINGS)
    (finding,) = consistency_findings(noises, SETTINGS)
    assert "at least 7 times worse than it is: 1.4 m/s, where the innovations leave at most" in finding.found
    # large innovations say nothing: they hold the errors of the prediction, too
    flights = [{"airspeed": {"told_noise": 1.4, "rms_innovation": 9.0}}] * 5
    assert consistency_findings(source_noises(table(flights), "present", NOW, SETTINGS), SETTINGS) == []


def test_innovations_that_speak_against_it_keep_a_finding_away() -> None:
    # the source seems quiet, yet its innovations are larger than told: something else is wrong
    noises = source_noises(table([{"gnss_vel": white(0.3, 0.05, innovation=0.4)}] * 8), "present", NOW, SETTINGS)
    assert consistency_findings(noises, SETTINGS) == []


def test_all_noises_that_are_off_make_a_set_together() -> None:
    flights = [{"gnss_vel": white(0.3, 0.1), "baro_hgt": white(3.5, 0.5)}] * 8
    noises = source_noises(table(flights), "present", NOW, SETTINGS)
    found = consistency_candidates(noises, SETTINGS)
    assert [one.name for one in found] == ["measured_gps_v_noise", "measured_baro_noise", "measured_noises"]
    assert found[-1].overrides == {"EKF2_GPS_V_NOISE": 0.1, "EKF2_BARO_NOISE": 0.5}
    findings = consistency_findings(noises, SETTINGS)
    assert [one.evidence["source"] for one in findings] == ["baro_hgt", "gnss_vel"]
    assert sentence_of_largest(findings).endswith(" (1 more below).")


def test_the_factor_from_which_it_matters_is_a_setting() -> None:
    noises = source_noises(table([{"gnss_vel": white(0.3, 0.1)}] * 8), "present", NOW, SETTINGS)
    assert consistency_findings(noises, replace(SETTINGS, noise_factor=3.0)) == []


@settings(max_examples=20)
@given(
    st.lists(st.tuples(st.floats(1e-3, 10.0), st.floats(0.0, 10.0)), min_size=1, max_size=6),
    st.floats(0.01, 100.0),
)
def test_the_unit_of_a_source_does_not_matter(errors: list[tuple[float, float]], unit: float) -> None:
    def noise(scale: float) -> SourceNoise:
        flights = [
            {"mag": wandering(0.05 * scale, one * scale, other * scale, math.hypot(one, 3.0 * other) * scale, 1.0)}
            for one, other in errors
        ]
        return noise_of(flights, "mag")

    one, other = noise(1.0), noise(unit)
    assert one.lower <= one.size * (1.0 + 1e-9)
    assert one.size < one.upper
    for name in ("size", "lower", "upper", "wanted"):
        assert getattr(other, name) == pytest.approx(unit * getattr(one, name), rel=1e-6)
