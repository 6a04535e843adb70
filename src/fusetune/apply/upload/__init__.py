"""Parameters brought onto a vehicle over MAVLink: checked, backed up, written, read back, or taken back."""
