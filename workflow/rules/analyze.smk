for number, first in enumerate(range(0, len(REPLAYED), SETTINGS["sets_per_job"]), 1):
    chunk = REPLAYED[first : first + SETTINGS["sets_per_job"]]

    # One job replays several sets; each set keeps its own files. They are updated, not made anew, so that a job that is
    # started for a new set leaves the others' files as they are.
    rule:
        name:
            f"replay_{number}"
        input:
            flight="results/save/{flight}",
            kernels=ancient(KERNELS_READY),
        output:
            update(
                expand(
                    "results/analyze/{{flight}}/{pset}.{part}",
                    pset=chunk,
                    part=REPLAY_PARTS,
                )
            ),
        log:
            f"results/logs/replay/{{flight}}.{number}.log",
        benchmark:
            f"results/benchmarks/replay/{{flight}}.{number}.tsv"
        conda:
            "../envs/fusetune.yaml"
        params:
            sets=overrides_of(chunk),
            withheld=SETTINGS["withheld"],
            reconstruction=SETTINGS["reconstruction"],
            start=SETTINGS["start"],
            ledger=f"results/analyze/{{flight}}/.replay_{number}.json",
            code=DIGEST["replay"],
        message:
            f"Analyze: replay {{wildcards.flight}} with {', '.join(chunk)}"
        script:
            "../scripts/replay_flight.py"


rule score_flight:
    input:
        flight="results/save/{flight}",
        replays=expand("results/analyze/{{flight}}/{pset}.{part}", pset=REPLAYED, part=REPLAY_PARTS),
    output:
        expand("results/analyze/{{flight}}/{part}", part=SCORE_PARTS),
    log:
        "results/logs/score/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    params:
        sets=SETS,
        present=PRESENT,
        scoring=SETTINGS["scoring"],
        reconstruction=SETTINGS["reconstruction"],
        start=SETTINGS["start"],
        trust=SETTINGS["trust"],
        code=DIGEST["score"],
    message:
        "Analyze: score {wildcards.flight}"
    script:
        "../scripts/score_flight.py"
