REPLAY_CHUNKS = [
    SETS.replayed[first : first + SETTINGS.sets_per_job]
    for first in range(0, len(SETS.replayed), SETTINGS.sets_per_job)
]


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
        benchmark:
            f"results/benchmarks/replay/{{flight}}.{number}.tsv"
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
    output:
        update(replay_files(REPLAY_CHUNKS[-1])),
        expand("results/analyze/{{flight}}/{part}", part=FLIGHT_FILES),
    log:
        "results/logs/analyze/{flight}.log",
    benchmark:
        "results/benchmarks/analyze/{flight}.tsv"
    # so that pictures are drawn while the decision, which needs all scores, is on its way
    priority: 1
    conda:
        "../envs/fusetune.yaml"
    resources:
        **replay_resources(len(REPLAY_CHUNKS[-1]), len(SETS.scored)),
    params:
        sets=overrides_of(REPLAY_CHUNKS[-1]),
        replay=asdict(SETTINGS.replay),
        code=DIGEST["replay"],
        scored=SETS.scored,
        present=PRESENT,
        scoring=asdict(SETTINGS.scoring),
        trust=asdict(SETTINGS.trust),
        score_code=DIGEST["score"],
    message:
        "Analyze: replay and score {wildcards.flight}"
    script:
        "../scripts/analyze_flight.py"
