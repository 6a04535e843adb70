"""What PX4's `EKF/` does, file by file: prediction, covariance, updates, control, resets, aid sources.

An aid source forms its innovation and says when it is fused (`aid_sources/`), `common/aid_source_status` tests it
against its gate, `measurement_update` corrects state and covariance.
"""
