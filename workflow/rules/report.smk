rule flight_page:
    input:
        flight="results/save/{flight}",
        diagnosis="results/analyze/{flight}/diagnosis.json",
        told=expand("results/analyze/{{flight}}/{file}", file=DIAGNOSED_FILES),
        track="results/analyze/{flight}/track.parquet",
        conformance="results/analyze/{flight}/conformance.json",
        scores=of_a_replayed_flight("scoring.json"),
        decision="results/apply/decision.json" if SHOWS_SOME_SETS else [],
    output:
        # told again is not told otherwise: the job looks up whether what it shows is as it was
        page=update(
            report(
                "results/report/flights/{flight}.html",
                caption="../report/flight_page.rst",
                category=FLIGHTS_STEP,
                labels=verdict_of_flight,
            )
        ),
        blob=update("results/report/flights/{flight}.blob"),
    log:
        "results/logs/flight_page/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB + 50, 3.0),
        runtime=of_its_logs(5, 0.05),
    params:
        code=DIGEST["report"],
        save_code=DIGEST["save"],
        # of a study around the present values that set alone: the others hardly differ to the eye
        sets=SETS.scored,
    message:
        "Report: the page of {wildcards.flight}"
    script:
        "../scripts/flight_page.py"


# Drawn when asked for, `snakemake sensors`: the pictures of a flight's sensors take longer than its analysis.
rule sensor_page:
    input:
        flight="results/save/{flight}",
        noise="results/analyze/{flight}/sensor_noise.json",
    output:
        "results/report/sensors/{flight}.html",
    log:
        "results/logs/sensor_page/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB + 50, 3.0),
        runtime=of_its_logs(5, 0.05),
    params:
        code=DIGEST["report"],
    message:
        "Report: draw the sensors of {wildcards.flight}"
    script:
        "../scripts/sensor_page.py"


rule all_sensors_page:
    input:
        noise=expand("results/analyze/{flight}/sensor_noise.json", flight=LOGS),
        health=expand("results/analyze/{flight}/health.json", flight=LOGS),
    output:
        "results/report/all_sensors.html",
    log:
        "results/logs/all_sensors_page.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(2 * LIBRARIES_MB, 0.1),
        runtime=of_its_logs(10, 0.01),
    params:
        code=DIGEST["report"],
    message:
        "Report: draw the sensors over all flights"
    script:
        "../scripts/all_sensors_page.py"


rule sensors:
    input:
        expand("results/report/sensors/{flight}.html", flight=LOGS),
        "results/report/all_sensors.html",
    localrule: True
    resources:
        mem_mb=LIBRARIES_MB,
        runtime=5,


rule build_report:
    input:
        flights="results/save/flights.parquet",
        scores=of_scored_flights("results/analyze/{flight}/scoring.json"),
        decision="results/apply/decision.json",
        sensitivity="results/apply/sensitivity.json",
        history="results/apply/history.json",
        diagnoses=expand("results/analyze/{flight}/diagnosis.json", flight=LOGS),
        pages=expand("results/report/flights/{flight}.html", flight=LOGS),
        blobs=expand("results/report/flights/{flight}.blob", flight=LOGS),
        fleet="results/apply/fleet.json",
        health="results/analyze/health.parquet",
        mission=rules.mission_map.output.outlook,
        map=rules.mission_map.output.map,
        missions="results/analyze/missions.json",
    output:
        report(
            "results/report.html",
            caption="../report/page.rst",
            category=DECISION_STEP,
            labels={"page": "report"},
        ),
    log:
        "results/logs/build_report.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(2 * LIBRARIES_MB, 0.1),
        runtime=of_its_logs(10, 0.01),
    params:
        code=DIGEST["report"],
    message:
        "Report: build results/report.html"
    script:
        "../scripts/build_report.py"
