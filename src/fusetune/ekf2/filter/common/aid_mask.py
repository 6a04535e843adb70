"""Bits of EKF2_AID_MASK, which says in v1.13 what is fused."""

MASK_GNSS, MASK_POSITION, MASK_YAW, MASK_ROTATE, MASK_VELOCITY = 1, 8, 16, 64, 256
