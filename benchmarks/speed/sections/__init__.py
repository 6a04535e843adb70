"""What is measured: one file a subject, with `QUANTITIES` and `measure(work)`, which yields name and value of each."""
