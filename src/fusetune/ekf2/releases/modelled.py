"""Refuse releases whose estimator is not modelled."""

from __future__ import annotations

from fusetune.ekf2.releases.behaviours import MODELLED
from fusetune.errors import UserError


def demand_modelled(release: str) -> None:
    """See that the estimator of a release can be replayed.

    Raises
    ------
    UserError
        It is not modelled, or there is no such release; names those that are.
    """
    if release not in MODELLED:
        reason = "is no release of PX4 whose estimator can be replayed yet"
        raise UserError(release, reason, f"Choose the nearest of {', '.join(MODELLED)}")
