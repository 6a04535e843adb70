"""Files of designs: what they may say, and how mistakes in them are told."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from tests.made_text import UpToDate
from tests.settings.configuration_texts import manual_text

from fusetune.design.covariance.changes import changed, factor_of
from fusetune.design.covariance.design_file import load_design
from fusetune.design.covariance.ekf2_design import Ekf2Design, Ekf2File
from fusetune.design.covariance.evaluation import evaluate
from fusetune.design.covariance.linear_design import LinearDesign, LinearFile
from fusetune.design.covariance.marker_landing import MarkerLanding
from fusetune.design.covariance.named_files import files_of_design
from fusetune.errors import UserError

LINEAR = {
    "kind": "linear",
    "name": "cart",
    "states": [{"name": "p", "unit": "m"}, {"name": "v", "unit": "m/s"}],
    "A": [[0, 1], [0, 0]],
    "step_rate_hz": 100,
    "noises": {"force": {"density": 0.5, "into": [0, 1]}},
    "sensors": {"sonar": {"H": [[1, 0]], "R": [[0.01]], "rate_hz": 10, "delay_ms": 40}},
}
EKF2 = {
    "kind": "ekf2",
    "name": "survey",
    "mission": "config/missions/survey.yaml",
    "vehicle": "config/vehicles/quadrotor.yaml",
    "sensors": {"gnss": {"rate_hz": 5, "delay_ms": 110}, "mag": {"rate_hz": 50}},
}


def loaded(document: dict, folder: Path) -> LinearDesign | Ekf2Design:  # type: ignore[type-arg]
    file = folder / "design.yaml"
    file.write_text(yaml.safe_dump(document, allow_unicode=True), encoding="utf-8")
    return load_design(file)


def test_the_examples_can_be_read(project_root: Path) -> None:
    files = sorted((project_root / "config/covariance").glob("*.yaml"))
    assert [load_design(file).name for file in files] == [file.stem for file in files]
    assert files_of_design(files[0])[1:] == ("config/missions/survey.yaml", "config/vehicles/quadrotor.yaml")


def test_a_double_integrator_given_as_matrices_has_the_gain_of_kalata(tmp_path: Path) -> None:
    """Kalata's tracking index (IEEE Transactions on Aerospace 20, 1984) gives α, β of a piecewise constant force.

    With Γ = q T²/√R: β² = Γ² (1 − α), α = 1 − (1 − s)², and P before the correction is R α / (1 − α).
    """
    T, q, R = 0.1, 0.5, 0.01
    Q = (q * T) ** 2 * 1.0
    document = LINEAR | {"A_d": [[1, T], [0, 1]], "step_rate_hz": 10,
                         "noises": {"force": {"density": Q**0.5, "into": [0.5 * T, 1.0]}},
                         "sensors": {"sonar": {"H": [[1, 0]], "R": [[R]], "rate_hz": 10}}}  # fmt: skip
    del document["A"]
    design = loaded(document, tmp_path)
    index = q * T**2 / R**0.5
    # r = (4 + Γ − √(8Γ + Γ²)) / 4, α = 1 − r²
    r = (4.0 + index - (8.0 * index + index**2) ** 0.5) / 4.0
    alpha = 1.0 - r**2
    assert design.deviations({})["p"].before ** 2 == pytest.approx(R * alpha / (1.0 - alpha), rel=1e-9)


def test_a_design_tells_what_pays_and_what_a_delay_costs(tmp_path: Path) -> None:
    evaluation = evaluate(loaded(LINEAR, tmp_path))
    names = {one.name for one in evaluation.evaluated}
    assert {"force: noise ÷2", "sonar: noise ×2", "sonar: rate ×2", "sonar: delay ÷2", "sonar: delay ×2"} <= names
    change = {one.name: one.change(evaluation.base, "p") for one in evaluation.evaluated}
    assert change["sonar: delay ÷2"] < 0.0 < change["sonar: delay ×2"]
    # all noises twice as large make every deviation twice as large
    both = loaded(LINEAR, tmp_path).deviations({"force.sd": "×2", "sonar.sd": "×2"})
    assert both["v"].before == pytest.approx(2.0 * evaluation.base["v"].before, rel=1e-9)


@pytest.mark.parametrize(
    ("document", "keys", "told"),
    [
        (LINEAR, {"kind": "cubic"}, "one of 'linear', 'ekf2'"),
        (LINEAR, {"name": "con"}, "device"),
        (LINEAR, {"A": [[0, 1]]}, "A is no matrix of 2 rows and 2 columns"),
        (LINEAR, {"A_d": [[1, 0], [0, 1]]}, "A, A_d: expected one of them"),
        (LINEAR, {"P0": [[1, 0], [0, -1]]}, "P0 has the eigenvalue -1"),
        (LINEAR, {"P0": [[1, 2], [0, 1]]}, "P0 is not symmetric"),
        (LINEAR, {"noises": {"force": {"density": 1, "into": [1]}}}, "force.into has 1 values; expected 2"),
        (LINEAR, {"noises": {"force": {"into": [1, 0]}}}, "expected either density"),
        (LINEAR, {"before": "lidar"}, "before is 'lidar'; expected one of sonar"),
        (LINEAR, {"judged": ["q"]}, "judged: 'q' is no state"),
        (LINEAR, {"variations": [{"name": "a", "changes": {"sonr.sd": "×2"}}]}, "did you mean 'sonar.sd'"),
        (LINEAR, {"variations": [{"name": "a", "changes": {"sonar.sd": 2}}]}, "expected a factor such as ×2"),
        (LINEAR, {"variations": [{"name": "a", "changes": {"sonar.used": 0}}]}, "expected true or false"),
        (
            LINEAR,
            {"variations": [{"name": "a", "changes": {"sonar.rate_hz": -1}}]},
            "lead to -1 Hz; expected 0.01 to 100000",
        ),
        (LINEAR, {"sweeps": [{"name": "s", "lines": ["sonar.sd"]}]}, "expected either values or factors"),
        (LINEAR, {"sweeps": [{"name": "s", "lines": ["sonar.rate_hz"], "values": [5, 0]}]}, "lead to 0 Hz"),
        (LINEAR, {"model": "marker_landing"}, "states: the model marker_landing has its own"),
        (EKF2, {"log": "a.ulg"}, "mission, log: expected one of them"),
        (EKF2, {"vehicle": None}, "mission, vehicle: expected both or none"),
        (EKF2, {"sensors": {"lidar": {"rate_hz": 5}}}, "'gnss'"),
        (EKF2, {"parameters": {"EKF2_GPS_V_NOIS": 1}}, "EKF2_GPS_V_NOISE"),
        (EKF2, {"variations": [{"name": "a", "changes": {"gnss.sd": "÷1000"}}]}, "EKF2_GPS_P_NOISE"),
        (EKF2, {"variations": [{"name": "a", "changes": {"gnss.delay_ms": 400}}]}, "delay_ms is 400"),
        (EKF2, {"variations": [{"name": "a", "changes": {"baro.sd": "×2"}}]}, "'baro.sd' is nothing that can change"),
        (EKF2, {"sweeps": [{"name": "s", "lines": ["gnss.sd"], "factors": [1, 2], "states": ["roll"]}]}, "'roll'"),
    ],
)
def test_a_mistake_is_told_with_file_reason_and_remedy(
    document: dict,  # type: ignore[type-arg]
    keys: dict,  # type: ignore[type-arg]
    told: str,
    tmp_path: Path,
) -> None:
    with pytest.raises(UserError, match=re.escape(told)) as error:
        loaded(document | keys, tmp_path)
    assert error.value.file.endswith("design.yaml")
    assert error.value.remedy


def test_times_of_a_discrete_model_are_whole_steps(tmp_path: Path) -> None:
    document = {key: value for key, value in LINEAR.items() if key != "A"} | {"A_d": [[1, 0.01], [0, 1]]}
    document["sensors"] = {"sonar": {"H": [[1, 0]], "R": [[0.01]], "rate_hz": 30}}
    with pytest.raises(UserError, match=r"period is 3\.33333 steps of A_d"):
        loaded(document, tmp_path)


def test_a_design_without_steady_state_says_what_it_lacks(tmp_path: Path) -> None:
    document = LINEAR | {"sensors": {"tacho": {"H": [[0, 1]], "R": [[0.01]], "rate_hz": 10}}}
    with pytest.raises(UserError, match="grows without end"):
        loaded(document, tmp_path).deviations({})
    both = {"sonar": LINEAR["sensors"]["sonar"] | {"rate_hz": 9.99}, "tacho": document["sensors"]["tacho"]}  # type: ignore[index]
    with pytest.raises(UserError, match="repeat only after 100 s"):
        loaded(LINEAR | {"sensors": both, "step_rate_hz": 5000}, tmp_path).deviations({})
    assert loaded(document | {"duration_s": 10}, tmp_path).deviations({})["p"].before > 0.0


def test_changes_are_values_or_factors() -> None:
    assert changed(4.0, 3) == 3.0
    assert [changed(4.0, text) for text in ("×2", "*2", "÷ 2", "/2", "×1e-1")] == [8.0, 8.0, 2.0, 2.0, 0.4]
    for wrong in ("2", "×", "×0", "×-1", "+1", "×1.2.3"):
        with pytest.raises(ValueError, match="expected a factor"):
            factor_of(wrong)


def test_the_manual_says_what_is_declared(project_root: Path, up_to_date: UpToDate) -> None:
    manual = project_root / "docs" / "covariance.md"
    for block, kind in (("ekf2", Ekf2File), ("linear", LinearFile), ("marker_landing", MarkerLanding)):
        up_to_date(manual, block, f"\n{manual_text(kind)}\n\n")
