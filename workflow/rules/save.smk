rule save_flight:
    input:
        log=lambda wildcards: LOGS[wildcards.flight],
    output:
        directory("results/save/{flight}"),
    log:
        "results/logs/save/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    params:
        code=DIGEST["save"],
        thresholds=SETTINGS["verdict"],
        simulated=not FLOWN_LOGS,
    message:
        "Save: read {input.log}"
    script:
        "../scripts/save_flight.py"


checkpoint list_flights:
    input:
        folders=expand("results/save/{flight}", flight=LOGS),
    output:
        table="results/save/flights.parquet",
        csv=report(
            "results/save/flights.csv",
            caption="../report/flights.rst",
            category="Flights",
            labels={"table": "verdicts"},
        ),
    log:
        "results/logs/list_flights.log",
    conda:
        "../envs/fusetune.yaml"
    params:
        code=DIGEST["save"],
    message:
        "Save: list which flights can be replayed"
    script:
        "../scripts/list_flights.py"
