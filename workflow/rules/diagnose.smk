# What is told of each flight before any set is compared: of every log, replayable or not.


rule tell_flight:
    input:
        flight="results/save/{flight}",
        missions=list(map(as_named, INPUTS.mission_files)),
        # what it says comes in as a parameter, so that only other values make anything again
        present=ancient(lambda wildcards: checkpoints.list_flights.get().output.present if MENDS_DELAYS else []),
        kernels=KERNELS_READY,
    output:
        # what of it is out of date the job looks up in a record of its own, and leaves all else as it is
        update(expand("results/analyze/{{flight}}/{file}", file=TOLD_FILES)),
    log:
        "results/logs/tell/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    # it holds log and replay at once, and a thinned log is the smaller one of a flight as long
    resources:
        mem_mb=of_its_logs(KERNELS_MB, DIAGNOSED_MB_PER_MB),
        runtime=of_its_logs(10, 0.1),
    params:
        present=lambda wildcards: present_found().parameters if MENDS_DELAYS else None,
        replay=asdict(SETTINGS.replay),
        health=asdict(SETTINGS.health),
        conformance=asdict(SETTINGS.conformance),
        contents=contents(*INPUTS.mission_files),
        code={
            "diagnosis": DIGEST["diagnose"],
            "delays": DIGEST["diagnose"],
            "conformance": DIGEST["conformance"],
        },
    message:
        "Analyze: what is wrong on {wildcards.flight}, its delays, which mission it flew"
    script:
        "../scripts/tell_flight.py"


rule join_health:
    input:
        expand("results/analyze/{flight}/health.json", flight=LOGS),
    output:
        "results/analyze/health.parquet",
    log:
        "results/logs/join_health.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=LIBRARIES_MB,
        runtime=of_its_logs(5, 0.001),
    params:
        code=DIGEST["diagnose"],
    message:
        "Analyze: the health of all flights in one table"
    script:
        "../scripts/join_health.py"


rule join_fleet:
    input:
        health="results/analyze/health.parquet",
        diagnoses=expand("results/analyze/{flight}/diagnosis.json", flight=LOGS),
    output:
        "results/apply/fleet.json",
    log:
        "results/logs/join_fleet.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=LIBRARIES_MB,
        runtime=of_its_logs(5, 0.001),
    params:
        code=DIGEST["apply"],
    message:
        "Apply: what all flights have in common, and what changed"
    script:
        "../scripts/join_fleet.py"
