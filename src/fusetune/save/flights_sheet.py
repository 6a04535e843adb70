"""The sheets of the save room: `flights.csv`, a row for each log, and `checks.csv`, a row for each check of each log.

Imports no numerics: the workflow reads the first whenever it has to know which flights can be replayed.
"""

from __future__ import annotations

from fusetune.storage.sheet import SheetColumn

FLIGHTS_SHEET = (
    SheetColumn("flight", "name of the flight, by the place of its log"),
    SheetColumn("file", "path of the log below the folder of flights"),
    SheetColumn("status", "`replayable`, or `refused`"),
    SheetColumn("reason", "why it is refused; empty where it is not"),
    SheetColumn("remedy", "what would mend that"),
    SheetColumn("failed_checks", "number of checks that failed; each is a row of `checks.csv`"),
    SheetColumn("warning_checks", "number of checks that warn"),
    SheetColumn("firmware", "release of PX4; `unknown` where the log does not say"),
    SheetColumn(
        "replayed_as", "release of PX4 whose estimator replays it; of a refused log that could be read, would replay it"
    ),
    SheetColumn("vehicle", "short name of what flew: board, end of its id, airframe"),
    SheetColumn("vehicle_uuid", "id of the board; empty in simulations and old releases"),
    SheetColumn("vehicle_hardware", "kind of the board"),
    SheetColumn("vehicle_airframe", "SYS_AUTOSTART, the number of the airframe"),
    SheetColumn("vehicle_type", "such as `quadrotor`"),
    SheetColumn("vehicle_kind", "`real`, or what was simulated: `SITL` or `HITL`"),
    SheetColumn(
        "recorded_utc", "when the log began, ISO 8601 in UTC; empty where neither GNSS nor name tell", "recorded"
    ),
    SheetColumn("duration_s", "length of the log"),
    SheetColumn("airborne_s", "time in the air"),
    SheetColumn("sha256", "checksum of the log, hexadecimal", "checksum"),
    SheetColumn("size_bytes", "size of the log"),
)

CHECKS_SHEET = (
    SheetColumn("flight", "as in `flights.csv`"),
    SheetColumn("check", "what was looked at", "id"),
    SheetColumn(
        "verdict", "`pass`, `warning`, `fail`, or `does-not-apply` where the flight has nothing of the kind", "severity"
    ),
    SheetColumn("figure", "what was measured; empty where nothing is"),
    SheetColumn("threshold", "from where on it matters"),
    SheetColumn("unit", "of both; empty for a pure number"),
    SheetColumn(
        "from_boot_s", "where the part of the flight that it is about begins, since boot; empty where that is all of it"
    ),
    SheetColumn("to_boot_s", "where it ends"),
    SheetColumn("found", "in words"),
    SheetColumn("remedy", "what the pilot can do about it"),
)
