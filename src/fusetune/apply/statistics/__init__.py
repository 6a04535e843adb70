"""What chance can do: bootstrap, sign flips, leave-one-out."""
