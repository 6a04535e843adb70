"""How many flights a gain takes to be found by the decision's own rule, from the flights already replayed."""
