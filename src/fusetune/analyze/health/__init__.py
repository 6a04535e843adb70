"""How sensors and filter did on a flight: one table of figures with their limits, of each estimator instance."""
