"""What is wrong with a vehicle: rules that join signs into causes, with evidence, confidence and remedy."""
