rule save_flight:
    input:
        # A flown log is no input: its content is what counts, not its time stamp, and no name of it can stop the others.
        log=lambda wildcards: LOGS[wildcards.flight] if DEMONSTRATED else [],
    output:
        directory("results/save/{flight}"),
    log:
        "results/logs/save/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB, 3.0),
        runtime=of_its_logs(5, 0.05),
    params:
        # not among what makes a job run again, for it asks for the input: where a log lies says nothing of it
        flown=lambda wildcards, input: None if DEMONSTRATED else vars(FLOWN_LOGS[wildcards.flight]),
        checksum=lambda wildcards: None if DEMONSTRATED else CONTENT.of(FLOWN_LOGS[wildcards.flight].path),
        code=DIGEST["save"],
        thresholds=asdict(SETTINGS.verdict),
        limits=asdict(SETTINGS.reading),
        release=SETTINGS.release,
    message:
        "Save: read {wildcards.flight}"
    script:
        "../scripts/save_flight.py"


checkpoint list_flights:
    input:
        folders=expand("results/save/{flight}", flight=LOGS),
        # which flight says what flies now can depend on how its replay is graded
        kernels=KERNELS_READY,
    output:
        # first, for by it Snakemake knows whether a job has the checkpoint behind it
        present="results/save/present.json",
        table="results/save/flights.parquet",
        csv=report(
            "results/save/flights.csv",
            caption="../report/flights.rst",
            category=FLIGHTS_STEP,
            labels={"table": "verdicts"},
        ),
        checks=report(
            "results/save/checks.csv",
            caption="../report/checks.rst",
            category=FLIGHTS_STEP,
            labels={"table": "checks"},
        ),
    log:
        "results/logs/list_flights.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_the_largest_log(KERNELS_MB, 5.0),
        runtime=of_its_logs(10, 0.02),
    params:
        refused=[list(astuple(entry)) for entry in INPUTS.found.refused],
        code=DIGEST["save"],
        varied=SETS.varied,
        around=list(SETS.around),
        present_flight=SETTINGS.present_flight,
        vehicle=SETTINGS.vehicle,
        replay=asdict(SETTINGS.replay),
        trust=asdict(SETTINGS.trust),
        lowest_grade=SETTINGS.decision.lowest_grade,
        grade_code=DIGEST["score"],
    message:
        "Save: list which flights can be replayed"
    script:
        "../scripts/list_flights.py"
