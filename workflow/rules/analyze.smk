# The present set is replayed by the job that estimates delays, where there is one.
REPLAY_CHUNKS = in_chunks([name for name in SETS.replayed if name != PRESENT or not MENDS_DELAYS])


if MENDS_DELAYS:

    rule estimate_delays:
        input:
            flight="results/save/{flight}",
            present=ancient("results/save/present.json"),
            kernels=KERNELS_READY,
        output:
            update(replay_files([PRESENT])),
            delays="results/analyze/{flight}/delays.json",
        log:
            "results/logs/delays/{flight}.log",
        conda:
            "../envs/fusetune.yaml"
        resources:
            **replay_resources(1, 1),
        params:
            sets=overrides_of([PRESENT]),
            replay=asdict(SETTINGS.replay),
            code=DIGEST["replay"],
            delay_code=DIGEST["delays"],
        message:
            "Analyze: replay {wildcards.flight} with the present parameters, estimate delays"
        script:
            "../scripts/estimate_delays.py"

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

    for number, chunk in enumerate(in_chunks(SETS.mendable), 1):

        rule:
            name:
                f"replay_mended_{number}"
            input:
                flight="results/save/{flight}",
                present=ancient("results/save/present.json"),
                delays=ancient("results/analyze/delays.json"),
                kernels=KERNELS_READY,
            output:
                update(replay_files([mended_name(name) for name in chunk])),
            log:
                f"results/logs/replay/{{flight}}.mended.{number}.log",
            conda:
                "../envs/fusetune.yaml"
            resources:
                **replay_resources(len(chunk)),
            params:
                sets=mended_overrides_of(chunk),
                replay=asdict(SETTINGS.replay),
                code=DIGEST["replay"],
            message:
                f"Analyze: replay {{wildcards.flight}} with mended delays, {', '.join(chunk)}"
            script:
                "../scripts/replay_flight.py"


# Replays of several sets are one job's work; each set keeps its own files. They are updated, not made anew, so that a
# job that is started for a new set leaves the others' files as they are. The last sets are replayed by the job that
# scores all; with no more sets than one job takes, there is no other.
for number, chunk in enumerate(REPLAY_CHUNKS[:-1], 1):

    rule:
        name:
            f"replay_{number}"
        input:
            flight="results/save/{flight}",
            present=ancient("results/save/present.json"),
            kernels=KERNELS_READY,
        output:
            update(replay_files(chunk)),
        log:
            f"results/logs/replay/{{flight}}.{number}.log",
        conda:
            "../envs/fusetune.yaml"
        resources:
            **replay_resources(len(chunk)),
        params:
            sets=overrides_of(chunk),
            replay=asdict(SETTINGS.replay),
            code=DIGEST["replay"],
        message:
            f"Analyze: replay {{wildcards.flight}} with {', '.join(chunk)}"
        script:
            "../scripts/replay_flight.py"


rule analyze_flight:
    input:
        flight="results/save/{flight}",
        # what it says comes in as a parameter, so that only other values make anything again
        present=ancient("results/save/present.json"),
        kernels=KERNELS_READY,
        replays=[file for chunk in REPLAY_CHUNKS[:-1] for file in replay_files(chunk)],
        delays=ancient("results/analyze/delays.json") if MENDS_DELAYS else [],
        effects=ancient("results/analyze/effects.json") if MENDS_DELAYS else [],
        present_replay=replay_files([PRESENT]) if MENDS_DELAYS else [],
        mended=of_mended_sets("results/analyze/{{flight}}/{pset}.{part}"),
        found="results/search/found.json" if SEARCH else [],
    output:
        update(replay_files(REPLAY_CHUNKS[-1])),
        expand("results/analyze/{{flight}}/{part}", part=FLIGHT_FILES),
    log:
        "results/logs/analyze/{flight}.log",
    # so that pictures are drawn while the decision, which needs all scores, is on its way
    priority: 1
    conda:
        "../envs/fusetune.yaml"
    # around the present values each parameter makes two sets at the most
    resources:
        **replay_resources(len(REPLAY_CHUNKS[-1]) + 2 * len(SETS.around), len(SETS.scored) + 2 * len(SETS.around)),
    params:
        sets=sets_of_analysis(REPLAY_CHUNKS[-1]),
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
        scores=of_replayable_flights("results/analyze/{flight}/scoring.json"),
        # asked for so that a set that is new is scored before flights are split
        replays=of_replayable_flights(ANALYZED_FILES),
    output:
        legs="results/analyze/legs.parquet",
        missions="results/analyze/missions.json",
    log:
        "results/logs/join_conformance.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(2 * LIBRARIES_MB, 0.1),
        runtime=of_its_logs(10, 0.02),
    params:
        code=DIGEST["conformance"],
    message:
        "Analyze: the scores by manoeuvre and leg, and what all flights made of each mission"
    script:
        "../scripts/join_conformance.py"
