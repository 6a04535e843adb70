"""Documents of a flight as health, diagnosis and effects leave them, and its saved log, for pages to be made of."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign, Trial
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.health.health_row import HealthRow
from fusetune.finding import Finding
from fusetune.px4.flight import Flight
from fusetune.save.flight_folder import write_flight
from fusetune.storage.documents import write_document

START_US = 5_000_000
TAKE_OFF_S, LANDING_S, END_S = 10.0, 50.0, 60.0
PERIOD_S = 0.1


def at(seconds: float) -> int:
    """µs since boot, of seconds from the start of the log."""
    return START_US + round(seconds * 1e6)


SHAKEN = Diagnosis(
    id="vibration",
    cause="The <frame> shakes the IMU",
    severity="fail",
    confidence=0.97,
    explains=4.0,
    start_us=at(20.0),
    stop_us=at(32.5),
    signs=(
        Sign("mean high-frequency acceleration 18.9 m/s²", 18.9, 4.9, "m/s²"),
        Sign("the bias moves by 0.4 m/s² in the air", 0.4, 0.4, "m/s²", "replay"),
    ),
    remedy="Isolate the autopilot",
    source="PX4's tuning guide",
    values={"EKF2_ACC_NOISE": 0.5},
    trial=Trial(
        "the replay with EKF2_ACC_NOISE 0.8 is no better: 0.0277 before, 0.0281 after", 0.0277, 0.0281, "no better"
    ),
)
LATE = Diagnosis(
    id="gnss_delay",
    cause="GNSS is later than PX4 is told",
    severity="note",
    confidence=0.6,
    explains=1.0,
    start_us=at(TAKE_OFF_S),
    stop_us=at(LANDING_S),
    signs=(),
    remedy="",
    source="",
)
DRAG = Effect(
    "drag",
    (
        Estimate("EKF2_BCOEF_X", "kg/m^2", 100.0, 60.0, 50.0, 70.0, 5.0, 900),
        Estimate("EKF2_MCOEF", "1/s", 0.15, 0.16, 0.1, 0.22, 0.03, 900),
        Estimate("wind_north", "m/s", None, 2.0, 1.5, 2.5, 0.2, 900),
    ),
)
SILENT = Effect("ground_effect", refusal="it never came near the ground; hover half a metre high")


def health_rows(*problems: Finding) -> list[HealthRow]:
    """Take-off and landing, a figure that passes, one that does not apply, and problems."""
    rows = [
        HealthRow(Finding("flight.take_off_s", "pass", "flight: take-off", figure=TAKE_OFF_S, unit="s"), "flight"),
        HealthRow(Finding("flight.landing_s", "pass", "flight: end", figure=LANDING_S, unit="s"), "flight"),
        HealthRow(
            Finding("gnss.eph", "pass", "GNSS: accuracy 0.8 m", figure=0.8, threshold=3.0, unit="m"), "GNSS quality"
        ),
        HealthRow(Finding("range.rate_hz", "does-not-apply", "range finder: not in the log"), "sensor"),
    ]
    return rows + [HealthRow(one, "aid source", place) for place, one in enumerate(problems)]


def rejected(source: str, share: float, since_s: float, until_s: float, severity: str = "fail") -> Finding:
    """Samples of a source that were rejected."""
    return Finding(
        f"{source}.rejected_share",
        severity,  # type: ignore[arg-type]
        f"{source}: samples rejected: {100 * share:.0f} %",
        "See which sensor is off",
        share,
        0.01,
        "",
        at(since_s),
        at(until_s),
    )


def write_documents(
    folder: Path,
    diagnoses: Sequence[Diagnosis] = (),
    rows: Sequence[HealthRow] | None = None,
    effects: Sequence[Effect] = (DRAG, SILENT),
    refused: Sequence[dict[str, str]] = (),
    *,
    readable: bool = True,
) -> Path:
    """Write the three documents into `results/analyze/<flight>`; `refused` is why it is not replayed."""
    folder.mkdir(parents=True, exist_ok=True)
    name = folder.name
    told: dict[str, Any] = {
        "flight": name,
        "vehicle": "board-4001",
        "firmware": "v1.16.0",
        "replayed_as": "v1.16",
        "replayed_why": "",
        "date": "2026-03-01T10:00:00Z",
    }
    found = health_rows() if rows is None else rows
    health = told | {"mission": "", "start_us": START_US, "rows": [one.document() for one in found]}
    write_document(folder / "health.json", health)
    told_causes = [one.document(START_US) for one in diagnoses]
    diagnosis = {"flight": name, "diagnoses": told_causes, "readable": readable, "refused": list(refused)}
    write_document(folder / "diagnosis.json", diagnosis | {"not_told": {}})
    write_document(folder / "effects.json", {"flight": name, "effects": [one.document() for one in effects]})
    return folder


def logged_flight(name: str = "flight") -> Flight:
    """A climb to 10 m and back in the topics of v1.16; GNSS velocity is beyond the gate about 30 s."""
    time = START_US + np.arange(0, round(END_S * 1e6), round(PERIOD_S * 1e6), dtype=np.int64)
    seconds = (time - START_US) * 1e-6
    height = np.interp(seconds, [TAKE_OFF_S, 20.0, 40.0, LANDING_S], [0.0, 10.0, 10.0, 0.0])
    still = np.zeros(time.size)
    position = {
        "x": still,
        "y": still,
        "z": -height,
        "vx": still + 1.0,
        "vy": still,
        "vz": -np.gradient(height, seconds),
    }
    ratio = np.where(np.abs(seconds - 30.0) < 1.0, 4.0, 0.01)
    velocity = {
        f"{field}[{axis}]": ratio for field in ("innovation", "innovation_variance", "test_ratio") for axis in range(3)
    }
    topics = {
        ("vehicle_local_position", 0): {"timestamp": time, **position},
        ("vehicle_land_detected", 0): {
            "timestamp": np.array([at(0.0), at(TAKE_OFF_S), at(LANDING_S)]),
            "landed": np.array([1, 0, 1], dtype=np.uint8),
        },
        ("estimator_aid_src_gnss_vel", 0): {"timestamp": time, "timestamp_sample": time, **velocity},
    }
    return Flight(name, topics=topics, info={"ver_sw_release": 0x01100000 | 0xFF}, start_timestamp=START_US,
                  last_timestamp=at(END_S))  # fmt: skip


def write_log(folder: Path) -> Path:
    """Write it as `results/save/<flight>`."""
    folder.mkdir(parents=True, exist_ok=True)
    write_flight(folder, logged_flight(folder.name))
    return folder
