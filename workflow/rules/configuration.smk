# What the user asked for: settings, parameter sets, mission and logs, checked before anything runs.
import re

from fusetune.design.mission import load_mission
from fusetune.design.study import load_study
from fusetune.execute.vehicle import load_vehicle
from fusetune.save.discovery import discover_logs
from fusetune.save.present import PRESENT, FlightSets

NO_FLIGHT = "(?!)"
CONFIG_FILE = configuration_files()[-1]


def with_defaults(values, schema):
    """Complete a checked configuration with the defaults of its schema."""
    for key, part in schema.get("properties", {}).items():
        if "properties" in part:
            values[key] = with_defaults(dict(values.get(key, {})), part)
        elif "default" in part:
            values.setdefault(key, part["default"])
    return values


def discovery():
    """Logs in the folder of flights and in folders below it, and what looks like one and cannot be flown."""
    folder = SETTINGS["flights_dir"]
    try:
        return discover_logs(folder)
    except OSError as error:
        raise UserError(
            CONFIG_FILE,
            f"flights_dir is {folder!r}, which is no folder that can be read ({error.strerror})",
            "Make it, mend its permissions, or name another",
        ) from error


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
        from fusetune.execute.sensors.faults import parse_faults

        for flight, faults in FAULTS.items():
            parse_faults(faults, f"{CONFIG_FILE}: demonstration.faults.{flight}")


SETTINGS = with_defaults(ASKED, CONFIG_SCHEMA)
STUDY = told_in_one_line(load_study, SETTINGS["study"])
MISSION = told_in_one_line(load_mission, SETTINGS["mission"])
SETS = FlightSets({pset.name: pset.overrides for pset in STUDY.sets})
DEMONSTRATION = demonstration_flights()
FAULTS = told_in_one_line(checked_faults)
FOUND = told_in_one_line(discovery)
FLOWN_LOGS = {log.flight: log for log in FOUND.logs}
# A folder with nothing but entries that cannot be flown is not empty: its user waits for a word on those.
DEMONSTRATED = not (FOUND.logs or FOUND.refused)
LOGS = {flight: log.path for flight, log in FLOWN_LOGS.items()}
if DEMONSTRATED:
    LOGS = {flight: f"results/execute/{flight}.ulg" for flight in DEMONSTRATION}
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
if DEMONSTRATED and workflow.is_main_process:
    told_in_one_line(check_demonstration)
if DEMONSTRATED:
    CONFIGURATION_FILES.append(SETTINGS["demonstration"]["vehicle"])


def contents(*files):
    """Params function: what files hold, so that one that is exchanged for an older one is noticed, too."""
    return lambda wildcards: {str(file): CONTENT.of(file) for file in files}
