SUMMARY_FIGURES = {
    "differences.svg": "scores against the present set",
    "flights_by_sets.svg": "flights and sets",
    "pareto.svg": "two aims",
    "drift.svg": "drift without GNSS",
    "sensitivity.svg": "what matters",
    "rms.svg": "RMS of innovations",
    "innovations.svg": "innovations",
    "normalised_innovations.svg": "normalised innovations",
    "consistency.svg": "consistency",
    "breaks.svg": "fusion breaks",
    "power.svg": "what more flights would find",
}


rule plot_flight:
    input:
        flight="results/save/{flight}",
        scores="results/analyze/{flight}/scoring.json",
        joined=when_delays_are_joined,
    output:
        report(
            "results/report/flights/{flight}.png",
            caption="../report/flight.rst",
            category=FLIGHTS_STEP,
            labels={"flight": "{flight}"},
        ),
    log:
        "results/logs/plot/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB, 1.5),
        runtime=of_its_logs(5, 0.05),
    params:
        # of a study around the present values that set alone: the others hardly differ to the eye
        sets=SETS.scored,
        present=PRESENT,
        code=DIGEST["report"],
    message:
        "Report: draw {wildcards.flight}"
    script:
        "../scripts/plot_flight.py"


rule flight_page:
    input:
        flight="results/save/{flight}",
        diagnosis="results/analyze/{flight}/diagnosis.json",
        told=expand("results/analyze/{{flight}}/{file}", file=DIAGNOSED_FILES),
        track="results/analyze/{flight}/track.parquet",
        conformance="results/analyze/{flight}/conformance.json",
    output:
        # told again is not told otherwise: the job looks up whether what it draws is as it was
        update(
            report(
                "results/report/flights/{flight}.html",
                caption="../report/flight_page.rst",
                category=FLIGHTS_STEP,
                labels=verdict_of_flight,
            )
        ),
    log:
        "results/logs/flight_page/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB, 3.0),
        runtime=of_its_logs(5, 0.05),
    params:
        code=DIGEST["report"],
        save_code=DIGEST["save"],
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
        mem_mb=of_its_logs(LIBRARIES_MB, 3.0),
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


rule fleet_page:
    input:
        fleet="results/apply/fleet.json",
        health="results/analyze/health.parquet",
        pages=expand("results/report/flights/{flight}.html", flight=LOGS),
    output:
        report(
            "results/fleet.html",
            caption="../report/fleet_page.rst",
            category=FLIGHTS_STEP,
            labels={"flight": "all flights"},
        ),
    log:
        "results/logs/fleet_page.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(2 * LIBRARIES_MB, 0.1),
        runtime=of_its_logs(10, 0.01),
    params:
        code=DIGEST["report"],
        save_code=DIGEST["save"],
    message:
        "Report: the page of all flights"
    script:
        "../scripts/fleet_page.py"


rule plot_summary:
    input:
        scores=of_scored_flights("results/analyze/{flight}/scoring.json"),
        decision="results/apply/decision.json",
        sensitivity="results/apply/sensitivity.json",
    output:
        [
            report(
                f"results/report/{figure}",
                caption="../report/summary.rst",
                category=DECISION_STEP,
                labels={"figure": label},
            )
            for figure, label in SUMMARY_FIGURES.items()
        ],
    log:
        "results/logs/plot_summary.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(2 * LIBRARIES_MB, 1.0),
        runtime=of_its_logs(10, 0.01),
    params:
        code=DIGEST["report"],
    message:
        "Report: draw the comparison of the sets"
    script:
        "../scripts/plot_summary.py"


rule build_report:
    input:
        flights="results/save/flights.parquet",
        scores=of_scored_flights("results/analyze/{flight}/scoring.json"),
        figures=of_replayable_flights("results/report/flights/{flight}.png"),
        summary=rules.plot_summary.output,
        decision="results/apply/decision.json",
        sensitivity="results/apply/sensitivity.json",
        history="results/apply/history.json",
        diagnoses=expand("results/analyze/{flight}/diagnosis.json", flight=LOGS),
        pages=expand("results/report/flights/{flight}.html", flight=LOGS),
        fleet="results/fleet.html",
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
