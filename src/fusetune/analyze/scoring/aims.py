"""What sets are judged by: kinds of prediction, of which each flight has some."""

from __future__ import annotations

AIDED, UNAIDED, SMOOTHED = "aided", "unaided", "smoothed"
"""One step ahead with all sensors in use; seconds ahead without GNSS; the velocity against the smoothed one."""

AIMS = (AIDED, UNAIDED, SMOOTHED)
