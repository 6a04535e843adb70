"""GNSS of the release at hand: checked when a sample is due or, until v1.14, as it arrives."""

from fusetune.ekf2.filter.aid_sources.gnss.arrived_gnss_control import control_arrived_gnss_fusion
from fusetune.ekf2.filter.aid_sources.gnss.gnss_by_mask import control_gnss_by_mask
from fusetune.ekf2.filter.aid_sources.gnss.gps_control import control_gnss_fusion
from fusetune.ekf2.releases.by_release import by_release

control_gnss = by_release(
    by_release(control_gnss_fusion, "checks_gnss_on_arrival", control_arrived_gnss_fusion),
    "aids_gnss_by_mask",
    control_gnss_by_mask,
)
"""Run GNSS for one update, with the sample in `ekf.sensors.gnss.sample` if `ekf.sensors.gnss.data_ready`."""
