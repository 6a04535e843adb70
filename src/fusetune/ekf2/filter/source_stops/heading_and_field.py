"""The magnetometer is fused no more, neither its heading nor its field."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.field_covariance import clear_field_covariance
from fusetune.ekf2.filter.quaternion_core.field_covariance import save_field_covariance
from fusetune.ekf2.releases.by_release import does

_leaves_declination_mode = does("clears_field_whenever_stopped")


@kernel
def clear_mag_faults(ekf):
    """No axis of the magnetometer is at fault."""
    ekf.fs.bad_mag_x = False
    ekf.fs.bad_mag_y = False
    ekf.fs.bad_mag_z = False


@kernel
def stop_field(ekf):
    """Fuse the field no more; what is known of its covariance is saved."""
    if not ekf.cs.mag_3d:
        return
    save_field_covariance(ekf)
    ekf.cs.mag_3d = False
    if not _leaves_declination_mode(ekf):
        ekf.cs.mag_dec = False
    clear_mag_faults(ekf)
    ekf.fs.bad_mag_decl = False


@kernel
def stop_heading(ekf):
    """Fuse the heading no more."""
    if ekf.cs.mag_hdg:
        ekf.cs.mag_hdg = False
        ekf.fs.bad_hdg = False


@kernel
def clear_heading_and_field(ekf, params):
    """Fuse neither; no field is known from now on."""
    stop_field(ekf)
    stop_heading(ekf)
    clear_field_covariance(ekf)


@kernel
def stop_heading_and_field(ekf, params):
    """Fuse neither, if one was fused."""
    if ekf.cs.mag_hdg or ekf.cs.mag_3d:
        clear_heading_and_field(ekf, params)
