"""The analyze room: replays every parameter set on every flight and measures how well each predicts the sensors."""
