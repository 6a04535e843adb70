"""What a flight itself tells: its phases, and references that its replays are compared with."""
