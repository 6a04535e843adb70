"""How much a log may ask for: time, and tables.

A file of half a megabyte can subscribe to thousands of topics of thousands of columns each, and every column costs as
much as thousands of rows. PX4's own logs have some hundred tables with some thousand columns. Rows need no limit of
their own: each lies in the file, so tables are never larger than it.
"""

from __future__ import annotations

from dataclasses import dataclass

from fusetune.settings.declaration import setting

RAISE_LIMITS = "Log fewer topics, or raise reading.max_tables and reading.max_columns in the configuration"


@dataclass(frozen=True)
class ReadingLimits:
    """What one log may ask for: time to read it, tables, and columns of all tables together.

    Section `reading` of the configuration.
    """

    time_limit_s: float = setting(
        300.0, "a log that takes longer to read, judge and save is refused; 0: no limit", unit="s", low=0, high=86400
    )
    max_tables: int = setting(
        1000,
        "with more topic instances only those that are used become tables, and the verdict says so",
        low=50,
        high=100_000,
    )
    max_columns: int = setting(30_000, "with more columns in all tables together likewise", low=1000, high=10_000_000)
