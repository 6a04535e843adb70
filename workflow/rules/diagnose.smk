# What is told of each flight before any set is compared: of every log, replayable or not.


rule diagnose_flight:
    input:
        flight="results/save/{flight}",
        kernels=KERNELS_READY,
    output:
        expand("results/analyze/{{flight}}/{file}", file=DIAGNOSED_FILES),
        track="results/analyze/{flight}/track.parquet",
    log:
        "results/logs/diagnose/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    # it holds log and replay at once, and a thinned log is the smaller one of a flight as long
    resources:
        mem_mb=of_its_logs(KERNELS_MB, DIAGNOSED_MB_PER_MB),
        runtime=of_its_logs(10, 0.1),
    params:
        replay=asdict(SETTINGS.replay),
        health=asdict(SETTINGS.health),
        code=DIGEST["diagnose"],
    message:
        "Analyze: what is wrong on {wildcards.flight}"
    script:
        "../scripts/diagnose_flight.py"


rule conform_flight:
    input:
        flight="results/save/{flight}",
        track="results/analyze/{flight}/track.parquet",
        missions=list(INPUTS.mission_files),
    output:
        "results/analyze/{flight}/conformance.json",
    log:
        "results/logs/conformance/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB, 0.3),
        runtime=of_its_logs(5, 0.01),
    params:
        settings=asdict(SETTINGS.conformance),
        contents=contents(*INPUTS.mission_files),
        code=DIGEST["conformance"],
    message:
        "Analyze: which mission {wildcards.flight} flew"
    script:
        "../scripts/conform_flight.py"


rule join_health:
    input:
        expand("results/analyze/{flight}/health.json", flight=LOGS),
    output:
        "results/analyze/health.parquet",
    log:
        "results/logs/join_health.log",
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
