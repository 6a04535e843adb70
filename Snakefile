# From flight logs to EKF2 parameters: design -> execute -> save -> analyze -> apply, and a report of it all.
from snakemake.utils import min_version

min_version("9.27")


report: "workflow/report/workflow.rst"


include: "workflow/rules/environment.smk"
include: "workflow/rules/configuration_files.smk"


configfile: "config/config.yaml"


include: "workflow/rules/configuration.smk"
include: "workflow/rules/common.smk"
include: "workflow/rules/resources.smk"
include: "workflow/rules/design.smk"
include: "workflow/rules/covariance.smk"
include: "workflow/rules/execute.smk"
include: "workflow/rules/save.smk"
include: "workflow/rules/search.smk"
include: "workflow/rules/diagnose.smk"
include: "workflow/rules/analyze.smk"
include: "workflow/rules/apply.smk"
include: "workflow/rules/history.smk"
include: "workflow/rules/report.smk"


wildcard_constraints:
    flight="|".join(map(re.escape, LOGS)) or NO_FLIGHT,
    design="|".join(map(re.escape, DESIGNS)) or NO_FLIGHT,


# What needs seconds of one core for all flights together runs beside Snakemake itself, wherever the flights are sent.
localrules:
    all,
    design,
    mission_map,
    list_flights,
    decide,
    keep_history,
    build_report,
    join_health,
    join_fleet,
    join_conformance,
    sensors,
    covariances,


rule all:
    default_target: True
    input:
        rules.design.output,
        rules.mission_map.output,
        rules.decide.output,
        rules.build_report.output,
        rules.join_health.output,
        # so that one that was taken away is made again; of files that a job asks for Snakemake keeps digests
        of_replayable_flights(REPLAYED_FILES),


if MENDS_DELAYS:

    localrules:
        join_delays,


for each in workflow.rules:
    each.set_input(before_any_job)


onstart:
    let_jobs_be_served()


onsuccess:
    print(closing_words())
