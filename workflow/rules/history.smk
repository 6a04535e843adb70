# What was decided, kept for good, and what flights that came after it show.


rule measure_change:
    input:
        flight="results/save/{flight}",
        fidelity="results/analyze/{flight}/fidelity.json",
        kernels=KERNELS_READY,
    output:
        directory("results/change/{flight}"),
    log:
        "results/logs/change/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        **replay_resources(2),
    params:
        change=lambda wildcards: changes_flown().get(wildcards.flight),
        replay=asdict(SETTINGS.replay),
        scoring=asdict(SETTINGS.scoring),
        code=DIGEST["change"],
    message:
        "Apply: what the change that {wildcards.flight} flew does on it"
    script:
        "../scripts/measure_change.py"


rule keep_history:
    input:
        decision="results/apply/decision.json",
        per_flight="results/apply/per_flight.parquet",
        flights="results/save/flights.parquet",
        listed="results/save/flights.csv",
        saved=of_replayable_flights("results/save/{flight}"),
        measured=of_flights_after("results/change/{flight}"),
    output:
        "results/apply/history.json",
    log:
        "results/logs/keep_history.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(2 * LIBRARIES_MB, 0.1),
        runtime=of_its_logs(5, 0.01),
    params:
        changes=lambda wildcards: {flight: one["of"] for flight, one in changes_flown().items()},
        history=HISTORY,
        decision=asdict(SETTINGS.decision) | {"seed": SETTINGS.seed},
        code=DIGEST["apply"],
    message:
        "Apply: keep the decision, and what flights show of those before it"
    script:
        "../scripts/keep_history.py"
