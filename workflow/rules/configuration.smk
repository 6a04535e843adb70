# What the user asked for: settings, parameter sets, mission and logs, checked before anything runs.
import re

from fusetune.design.mission import load_mission
from fusetune.design.study import load_study
from fusetune.execute.vehicle import load_vehicle

PRESENT = "present"
AS_FLOWN = "as_flown"
CONFIG_FILE = configuration_files()[-1]


def with_defaults(values, schema):
    """Complete a checked configuration with the defaults of its schema."""
    for key, part in schema.get("properties", {}).items():
        if "properties" in part:
            values[key] = with_defaults(dict(values.get(key, {})), part)
        elif "default" in part:
            values.setdefault(key, part["default"])
    return values


def discovered_logs():
    """Logs in the folder of flights and in folders below it, name of the flight -> file."""
    folder = SETTINGS["flights_dir"]
    if not os.path.isdir(folder):
        raise UserError(
            CONFIG_FILE,
            f"flights_dir is {folder!r}, which is no folder",
            "Make it or name another",
        )
    found = glob_wildcards(os.path.join(folder, "{flight}.{suffix,[uU][lL][gG]}"))
    logs = {}
    for stem, suffix in sorted(zip(found.flight, found.suffix)):
        file, flight = os.path.join(folder, f"{stem}.{suffix}"), os.path.basename(stem)
        if flight.startswith("."):
            continue
        if flight in logs:
            raise UserError(
                file,
                f"gives the same flight name as {logs[flight]}",
                "Rename one of the two",
            )
        logs[flight] = file
    return logs


def demonstration_flights():
    """Simulated flights, name -> set flown: every set of the study in turn, as in the paper's experiment."""
    turns = [pset.name for _ in range(SETTINGS["demonstration"]["flights_per_set"]) for pset in STUDY.sets]
    digits = len(str(len(turns)))
    return {f"flight_{number:0{digits}}_{name}": name for number, name in enumerate(turns, 1)}


def checked_faults():
    faults = SETTINGS["demonstration"]["faults"]
    for flight in faults:
        if flight not in DEMONSTRATION:
            raise UserError(
                CONFIG_FILE,
                f"demonstration.faults names the flight {flight!r}; expected one of {', '.join(DEMONSTRATION)}",
                "Mend the name",
            )
    return faults


def check_demonstration():
    """Check what jobs would read of the demonstration, so that no job has to fail of it."""
    load_vehicle(SETTINGS["demonstration"]["vehicle"])
    if FAULTS:
        from fusetune.execute.faults import parse_faults

        for flight, faults in FAULTS.items():
            parse_faults(faults, f"{CONFIG_FILE}: demonstration.faults.{flight}")


SETTINGS = with_defaults(ASKED, CONFIG_SCHEMA)
STUDY = told_in_one_line(load_study, SETTINGS["study"])
MISSION = told_in_one_line(load_mission, SETTINGS["mission"])
OVERRIDES = {pset.name: pset.overrides for pset in STUDY.sets}
SETS = [PRESENT, *OVERRIDES]
VARIED = sorted({name for overrides in OVERRIDES.values() for name in overrides})
# The log's own parameters are replayed, too, to be compared with what the vehicle logged; they are not ranked.
REPLAYED = [*SETS, AS_FLOWN]
DEMONSTRATION = demonstration_flights()
FAULTS = told_in_one_line(checked_faults)
FLOWN_LOGS = told_in_one_line(discovered_logs)
LOGS = FLOWN_LOGS or {flight: f"results/execute/{flight}.ulg" for flight in DEMONSTRATION}
if SETTINGS["present_flight"] not in (None, *LOGS):
    raise WorkflowError(
        f"{CONFIG_FILE}: present_flight is {SETTINGS['present_flight']!r}, which is no flight in "
        f"{SETTINGS['flights_dir']!r}. Name one of its logs without .ulg, or leave it empty for the newest."
    )
CONFIGURATION_FILES = [
    *map(str, workflow.configfiles),
    SETTINGS["study"],
    SETTINGS["mission"],
]
if not FLOWN_LOGS and workflow.is_main_process:
    told_in_one_line(check_demonstration)
if not FLOWN_LOGS:
    CONFIGURATION_FILES.append(SETTINGS["demonstration"]["vehicle"])
