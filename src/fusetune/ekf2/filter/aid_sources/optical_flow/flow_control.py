"""Which control of optical flow a release has."""

from fusetune.ekf2.filter.aid_sources.optical_flow.flow_over_terrain import control_flow_over_terrain
from fusetune.ekf2.filter.aid_sources.optical_flow.integrated_flow import control_integrated_flow
from fusetune.ekf2.filter.aid_sources.optical_flow.integrated_flow_at_once import control_flow_at_once
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_control import control_optical_flow_fusion
from fusetune.ekf2.releases.by_release import by_release

_control_rates = by_release(control_optical_flow_fusion, "flies_flow_over_terrain", control_flow_over_terrain)

control_flow_fusion = by_release(
    by_release(_control_rates, "integrates_flow", control_integrated_flow), "fuses_flow_at_once", control_flow_at_once
)
