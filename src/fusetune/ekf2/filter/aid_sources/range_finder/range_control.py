"""Which control of the range finder a release has."""

from fusetune.ekf2.filter.aid_sources.range_finder.range_for_height import control_range_for_height
from fusetune.ekf2.filter.aid_sources.range_finder.range_height_control import control_range_hagl_fusion
from fusetune.ekf2.releases.by_release import by_release

control_range_fusion = by_release(control_range_hagl_fusion, "takes_range_for_height", control_range_for_height)
