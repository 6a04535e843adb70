# What the user asked for: settings, parameter sets, mission and logs, checked before anything runs.
import re
from dataclasses import asdict

from fusetune.inputs import check_demonstration, read_inputs
from fusetune.save.present import PRESENT, FlightSets

NO_FLIGHT = "(?!)"
# In the report of Snakemake, which sorts them by name.
DESIGN_STEP, FLIGHTS_STEP, DECISION_STEP = "1 Design", "2 Flights", "3 Decision"
CONFIG_FILE = (configuration_files() or [GIVEN_NAME])[-1]

INPUTS = told_in_one_line(read_inputs, SETTINGS, CONFIG_FILE)
DEMONSTRATED = INPUTS.is_demonstration
SEARCH = INPUTS.study.search
SETS = FlightSets(
    {pset.name: pset.overrides for pset in INPUTS.study.sets}, INPUTS.study.around, SEARCH.varied if SEARCH else ()
)
FLOWN_LOGS = {log.flight: log for log in INPUTS.found.logs}
LOGS = {flight: log.path for flight, log in FLOWN_LOGS.items()}
if DEMONSTRATED:
    LOGS = {flight: f"results/execute/{flight}.ulg" for flight in INPUTS.flights}
CONFIGURATION_FILES = [
    *map(str, workflow.configfiles),
    INPUTS.study_file,
    SETTINGS.mission,
]
if DEMONSTRATED and workflow.is_main_process:
    told_in_one_line(check_demonstration, SETTINGS, CONFIG_FILE)
if DEMONSTRATED:
    CONFIGURATION_FILES.append(SETTINGS.demonstration.vehicle)
MISSION_VEHICLE = [SETTINGS.mission_vehicle] if SETTINGS.mission_vehicle else []
if DEMONSTRATED and not MISSION_VEHICLE:
    MISSION_VEHICLE = [SETTINGS.demonstration.vehicle]


def as_named(file):
    """Input that lies where the configuration says, whatever prefix a workflow gives this one as a module."""
    return local(str(file))


def contents(*files):
    """Params function: what files hold, so that one that is exchanged for an older one is noticed, too."""
    return lambda wildcards: {str(file): CONTENT.of(file) for file in files}
