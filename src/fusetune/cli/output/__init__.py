"""What sub-commands share of telling: tables, documents, the progress of a run, what a shell completes."""
