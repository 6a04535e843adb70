"""What the views read of a saved flight: the vehicle's own topics, no more of them than is shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from fusetune.analyze.replaying.onboard import INNOVATION_TOPICS
from fusetune.px4.aid_sources import vector
from fusetune.px4.flight import Flight, TopicTable
from fusetune.px4.flown_parameters import flown_parameters
from fusetune.px4.layouts.estimator_instances import rows_of_primary
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight
from fusetune.storage.files import AnyPath

_WHOLE = (
    "battery_status",
    "distance_sensor",
    "estimator_event_flags",
    "estimator_selector_status",
    "estimator_sensor_bias",
    "estimator_states",
    "estimator_status",
    "estimator_status_flags",
    "airspeed",
    "airspeed_validated",
    "sensor_gps",
    "vehicle_air_data",
    "vehicle_gps_position",
    "vehicle_imu_status",
    "vehicle_land_detected",
    "vehicle_local_position",
    "vehicle_magnetometer",
    "vehicle_status",
    "wind",
)
_PARTS = {
    "vehicle_attitude": ("timestamp_sample", *vector("q", 4)),
    "vehicle_optical_flow": ("timestamp_sample", "quality"),
    "optical_flow": ("timestamp_sample", "quality"),
    "vehicle_attitude_groundtruth": ("timestamp_sample", *vector("q", 4)),
    "vehicle_local_position_groundtruth": (
        "timestamp_sample", "x", "y", "z", "vx", "vy", "vz", "ref_lat", "ref_lon", "ref_alt"
    ),
}  # fmt: skip
"""Topics with a row for every update: of these the columns that are shown."""
_RAW = {
    "sensor_combined": ("gyro_integral_dt", *vector("gyro_rad"), *vector("accelerometer_m_s2")),
    "vehicle_imu": ("delta_angle_dt",),
}
"""What is shown as it was logged, and by what vibration metrics of old releases are divided. Without their other
columns these are no canonical topics, so they stay apart."""


@dataclass(frozen=True)
class Logged:
    """A log as the views read it.

    Attributes
    ----------
    raw : in the layout of its own release
    flight : in the layout of v1.16
    """

    raw: Flight
    flight: Flight

    @cached_property
    def parameters(self) -> Mapping[str, float]:
        """All that the estimator had when the log began."""
        return flown_parameters(self.flight)

    @cached_property
    def status_flags(self) -> TopicTable | None:
        """`estimator_status_flags` of the estimator that was primary at each time."""
        return self.of_primary("estimator_status_flags")

    def topic(self, name: str, instance: int = 0) -> TopicTable | None:
        """A topic in the layout of v1.16, if it has rows."""
        table = self.flight.topic(name, instance)
        return table if table is not None and table["timestamp"].size else None

    def of_primary(self, name: str) -> TopicTable | None:
        """A topic of the estimator that was primary at each time, if it has rows."""
        table = rows_of_primary(self.flight, name)
        return table if table is not None and table["timestamp"].size else None


def read_logged(folder: AnyPath, *, innovations: bool) -> Logged:
    """Read `results/save/<flight>`.

    Parameters
    ----------
    innovations : whether those that the vehicle logged are read as well

    Raises
    ------
    UserError
        It is not the folder of a saved flight, or a file in it is damaged.
    """
    wanted = dict.fromkeys((*_WHOLE, *(INNOVATION_TOPICS if innovations else ())), None) | _PARTS
    loaded = load_flight(folder, wanted | _RAW)
    shown = loaded.with_topics({key: table for key, table in loaded.topics.items() if key[0] not in _RAW})
    return Logged(loaded, canonical(shown))
