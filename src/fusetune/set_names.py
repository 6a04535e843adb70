"""Names of sets that no study may give: the product adds sets of its own, and files beside those of the sets."""

from __future__ import annotations

PRESENT = "present"
AS_FLOWN = "as_flown"
ONBOARD = "onboard"
"""What the vehicle flies now, each log's own parameters (`fusetune.save.present`), and the vehicle's own estimator."""

RESERVED_SET_NAMES = (PRESENT, AS_FLOWN, ONBOARD, "sets", "scoring", "fidelity")
"""With the names of `sets.parquet`, `scoring.json` and `fidelity.json`, which a set so called would overwrite."""
