"""How many flights a gain takes to be found by the decision's own rule."""
