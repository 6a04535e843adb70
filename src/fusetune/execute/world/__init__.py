"""What truly happens: the earth, the wind, the path and the motion of the vehicle."""
