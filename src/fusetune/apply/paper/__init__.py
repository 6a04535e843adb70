"""The paper's rule, for comparison."""
