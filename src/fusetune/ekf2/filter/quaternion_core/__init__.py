"""The core of v1.13 and v1.14: attitude errors are additive in the four elements of the quaternion.

Error states have the places that they have in v1.16, but for the attitude: q0, q1, q2 stand where v1.16 has its errors
about north, east and down, q3 where it has the terrain, which these releases estimate apart. Biases are increments of
angle (rad) and velocity (m/s) over the mean interval of the filter.
"""
