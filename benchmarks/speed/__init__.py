"""How fast everything is, in one command: `python -m benchmarks`, see benchmarks/README.md.

A section (`sections/`) measures one subject on one revision, in a process of its own. `command` chooses sections and
revisions and lets revisions take turns, `results` gathers what they found, `table` and `comparison` tell it.
"""
