"""What the diagnoses of flights have to say to the decision."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fusetune.apply.flight_problems import (
    FlightDiagnoses,
    problem_findings,
    problem_sentence,
    read_diagnoses,
)
from fusetune.storage.documents import write_document


def diagnosis(cause: str, severity: str = "warning", confidence: float = 0.9, **values: float) -> dict[str, Any]:
    words = {"id": cause, "cause": f"The {cause} is off", "severity": severity, "confidence": confidence}
    return words | {"remedy": f"Mend the {cause}", "values": values}


def test_a_cause_is_told_once_with_its_flights_the_worst_first() -> None:
    flights = [
        FlightDiagnoses("one", (diagnosis("mag"), diagnosis("imu", "fail", 0.7))),
        FlightDiagnoses("two", (diagnosis("imu"),)),
        FlightDiagnoses("three", (diagnosis("mag", "note"), diagnosis("baro", confidence=0.3))),
        # told by the decision itself, from all flights
        FlightDiagnoses("four", (diagnosis("gnss_delay"), diagnosis("noise_claim"))),
    ]
    imu, mag = problem_findings(flights)
    assert (imu.id, imu.severity, imu.figure, imu.found) == (
        "diagnosis.imu", "fail", 2.0, "The imu is off (on 2 of 4 flights)"
    )  # fmt: skip
    assert imu.evidence["flights"] == "one, two"
    assert (mag.severity, mag.figure) == ("warning", 1.0)
    assert problem_sentence([imu, mag]) == (
        "Mend this first, and tune on flights after it, for it may change the choice: the imu is off (on 2 of 4 "
        "flights); the mag is off (on 1 of 4 flights)."
    )


def test_what_a_parameter_of_ekf2_mends_is_no_reason_to_wait() -> None:
    (found,) = problem_findings([FlightDiagnoses("one", (diagnosis("delay", EKF2_GPS_DELAY=40.0),))])
    assert found.found == "The delay is off (on one)"
    assert problem_sentence([found]) == ""
    assert problem_sentence([]) == ""


def test_names_keep_their_capitals_within_the_sentence() -> None:
    lost = diagnosis("gnss", "fail") | {"cause": "GNSS is lost in flight"}
    sentence = problem_sentence(problem_findings([FlightDiagnoses("one", (lost,))]))
    assert sentence.endswith(": GNSS is lost in flight (on one).")


def test_diagnoses_are_read_as_they_were_written(tmp_path: Path) -> None:
    document = {"flight": "one", "diagnoses": [diagnosis("mag")]}
    write_document(tmp_path / "diagnosis.json", document)
    assert read_diagnoses(tmp_path / "diagnosis.json") == FlightDiagnoses("one", (diagnosis("mag"),))
