if MENDS_DELAYS:

    # Whether there are sets with mended delays, or with other effects as measured, is known when all flights have told.
    checkpoint join_delays:
        input:
            present="results/save/present.json",
            flights="results/save/flights.parquet",
            listed="results/save/flights.csv",
            delays=of_replayable_flights("results/analyze/{flight}/delays.json"),
            effects=of_replayable_flights("results/analyze/{flight}/effects.json"),
        output:
            delays="results/analyze/delays.json",
            effects="results/analyze/effects.json",
        log:
            "results/logs/join_delays.log",
        localrule: True
        conda:
            "../envs/fusetune.yaml"
        resources:
            mem_mb=LIBRARIES_MB,
            runtime=5,
        params:
            settings=asdict(SETTINGS.delays),
            code=DIGEST["delays"],
            effects_code=DIGEST["diagnose"],
        message:
            "Analyze: compare the sensors' delays and single effects with what PX4 is told"
        script:
            "../scripts/join_delays.py"


# Where cores are more than flights, a flight has several, for its sets are worked on side by side. No figure depends on it.
THREADS_OF_A_FLIGHT = max(1, min(MOST_THREADS_OF_A_FLIGHT, CORES // max(1, len(LOGS))))


# All sets of a flight are one job's work. Of those that follow from what the flights show it is known too late that they
# are, and of the others they may be thousands: only the files of the two that others read are asked for by name. What
# of a set is out of date the job looks up in a record of its own, and leaves all else as it is.
rule analyze_flight:
    input:
        flight="results/save/{flight}",
        # what it says comes in as a parameter, so that only other values make anything again
        present=ancient("results/save/present.json"),
        kernels=KERNELS_READY,
        delays=ancient("results/analyze/delays.json") if MENDS_DELAYS else [],
        effects=ancient("results/analyze/effects.json") if MENDS_DELAYS else [],
        joined=when_delays_are_joined,
        found="results/search/found.json" if SEARCH else [],
    output:
        update(REPLAYED_FILES),
        SCORED_FILES,
    log:
        "results/logs/analyze/{flight}.log",
    # so that pictures are drawn while the decision, which needs all scores, is on its way
    priority: 1
    conda:
        "../envs/fusetune.yaml"
    threads: THREADS_OF_A_FLIGHT
    resources:
        **replay_resources(
            len(SETS.replayed) + 2 * len(SETS.around),
            MOST_SETS,
            THREADS_OF_A_FLIGHT,
        ),
    params:
        sets=sets_of_analysis,
        replay=asdict(SETTINGS.replay),
        code=DIGEST["replay"],
        scored=scored_sets,
        present=PRESENT,
        scoring=asdict(SETTINGS.scoring),
        trust=asdict(SETTINGS.trust),
        score_code=DIGEST["score"],
    message:
        "Analyze: replay and score {wildcards.flight}"
    script:
        "../scripts/analyze_flight.py"


rule join_conformance:
    input:
        conformance=expand("results/analyze/{flight}/conformance.json", flight=LOGS),
        listed="results/save/flights.csv",
        scores=of_scored_flights("results/analyze/{flight}/scoring.json"),
    output:
        legs="results/analyze/legs.parquet",
        missions="results/analyze/missions.json",
    log:
        "results/logs/join_conformance.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    # of a thousand sets the samples of a flight are read and summed in some 0.8 s; nearly nothing else runs then
    threads: JOINED_AT_ONCE
    resources:
        mem_mb=of_its_logs(2 * LIBRARIES_MB + JOINED_MB_PER_SET * JOINED_AT_ONCE * MOST_SETS, 0.1),
        runtime=of_its_logs(10, 0.02),
    params:
        code=DIGEST["conformance"],
    message:
        "Analyze: the scores by manoeuvre and leg, and what all flights made of each mission"
    script:
        "../scripts/join_conformance.py"
