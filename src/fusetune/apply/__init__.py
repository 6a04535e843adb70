"""The apply room: compares the parameter sets over all flights, decides, and writes what the vehicle loads.

The way of a set: its `evidence` on each flight, its score and interval in the `ranking`, what its `vetoes` hold against
it, the `choice`; `decide` goes that way for the pipeline.
"""
