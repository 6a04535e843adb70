"""Tags of PX4's releases: the commit that a log names, the release that it is, and when it was made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Tag(NamedTuple):
    """A tag of PX4's repository: its name, and the day of its commit."""

    name: str
    date: str


DIGITS = 12
"""How many of a commit's hexadecimal digits stand here, and are compared."""

TAGS: Mapping[str, Tag] = {
    "96443b3cf3e3": Tag("v1.8.0", "2018-06-19"),
    "82aa24adfca2": Tag("v1.8.1", "2018-10-19"),
    "f13bbacd5277": Tag("v1.8.2", "2018-11-12"),
    "ea48cd497097": Tag("v1.9.0", "2019-05-22"),
    "f8db8650d0e5": Tag("v1.9.1", "2019-06-24"),
    "106905871d37": Tag("v1.9.2", "2019-07-03"),
    "4f6faac2c86d": Tag("v1.10.0", "2019-12-12"),
    "e0f016c2b3db": Tag("v1.10.1", "2020-01-21"),
    "b135c69db28a": Tag("v1.10.2", "2020-03-22"),
    "71db0903a910": Tag("v1.11.0", "2020-09-07"),
    "9fcbf18d82b8": Tag("v1.11.1", "2020-10-05"),
    "97ab8277ed16": Tag("v1.11.2", "2020-11-12"),
    "a6274bc5ed01": Tag("v1.11.3", "2021-01-01"),
    "9524e8ec032c": Tag("v1.12.0", "2021-07-05"),
    "1682fd567142": Tag("v1.12.1", "2021-08-01"),
    "ba0b512f0d39": Tag("v1.12.2", "2021-08-31"),
    "2e8918da66af": Tag("v1.12.3", "2021-09-06"),
    "6823cbc4140e": Tag("v1.13.0", "2022-06-07"),
    "dc7f29e2ec7a": Tag("v1.13.1", "2022-10-05"),
    "46a12a09bf11": Tag("v1.13.2", "2022-11-22"),
    "1c8ab2a0d7db": Tag("v1.13.3", "2023-03-06"),
    "b8c541dd7277": Tag("v1.14.0", "2023-10-18"),
    "beb834af2b48": Tag("v1.14.1", "2024-01-11"),
    "968732477803": Tag("v1.14.2", "2024-02-15"),
    "1dacb4cdef2d": Tag("v1.14.3", "2024-05-16"),
    "1555f2bd2229": Tag("v1.14.4", "2024-08-21"),
    "30e763b67800": Tag("v1.15.0", "2024-08-27"),
    "93eef0c78719": Tag("v1.15.1", "2024-10-01"),
    "4817c0618a12": Tag("v1.15.2", "2024-11-06"),
    "80171359656f": Tag("v1.15.3", "2024-11-19"),
    "99c40407ffd7": Tag("v1.15.4", "2025-02-06"),
    "6ea3539157ca": Tag("v1.16.0", "2025-08-05"),
    "15f5fefa0c7c": Tag("v1.17.0-beta1", "2026-01-16"),
}
"""First digits of a commit → its tag. Source: the tags of github.com/PX4/PX4-Autopilot."""
