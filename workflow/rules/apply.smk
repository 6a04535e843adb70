rule decide:
    input:
        flights="results/save/flights.parquet",
        # all that the vehicle has, for its parameter files
        saved=of_replayable_flights("results/save/{flight}"),
        present="results/save/present.json",
        # what the input functions read: where it is missing, the checkpoint has to run again
        listed="results/save/flights.csv",
        scores=of_scored_flights("results/analyze/{flight}/scoring.json"),
        # asked for so that a file that was taken away is made again
        tables=of_scored_flights(SCORED_FILES),
        delays="results/analyze/delays.json" if MENDS_DELAYS else [],
        effects="results/analyze/effects.json" if MENDS_DELAYS else [],
        diagnoses=of_replayable_flights("results/analyze/{flight}/diagnosis.json"),
        legs="results/analyze/legs.parquet",
        found="results/search/found.json" if SEARCH else [],
        matters="results/search/sensitivity.json" if SEARCH else [],
        configuration=list(map(as_named, CONFIGURATION_FILES)),
    output:
        "results/apply/ranking.parquet",
        "results/apply/per_flight.parquet",
        report(
            "results/apply/ranking.csv",
            caption="../report/ranking.rst",
            category=DECISION_STEP,
            labels={"table": "ranking"},
        ),
        report(
            "results/apply/decision.json",
            caption="../report/decision.rst",
            category=DECISION_STEP,
            labels={"table": "decision with its evidence, and where it comes from"},
        ),
        report(
            "results/apply/best_params.params",
            caption="../report/best_params.rst",
            category=DECISION_STEP,
            labels={"table": "parameters to load"},
        ),
        report(
            f"results/apply/{PARAMETER_FILES[1]}",
            caption="../report/rollback.rst",
            category=DECISION_STEP,
            labels={"table": "what undoes it"},
        ),
        [f"results/apply/{name}" for name in PARAMETER_FILES[2:]],
        "results/apply/candidates.yaml",
        "results/apply/sensitivity.json",
        search="results/search/search.json" if SEARCH else [],
    log:
        "results/logs/decide.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(2 * LIBRARIES_MB + DECIDED_MB_PER_PAIR * MOST_SETS * len(LOGS), 0.1),
        runtime=of_its_logs(10, 0.01),
    params:
        sets=scored_sets,
        present=PRESENT,
        descriptions=set_descriptions,
        decision=asdict(SETTINGS.decision) | {"seed": SETTINGS.seed},
        contents=contents(*CONFIGURATION_FILES),
        code=DIGEST["apply"],
    message:
        "Apply: rank the sets, decide"
    script:
        "../scripts/decide.py"
