"""What PX4's estimator does differently in other releases than v1.16: named behaviours, asked while kernels compile."""
