"""What the estimators of other releases of PX4 would have done on a flight."""
