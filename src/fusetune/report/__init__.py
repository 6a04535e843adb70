"""The report: figures and one self-contained page, from what the rooms wrote."""
