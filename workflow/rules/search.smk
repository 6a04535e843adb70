# A search: what it asks for in each round, and what flights answer. All rounds are planned at once, for how many there are
# follows from the study alone; those that a search does not need ask for nothing.
from fusetune.apply.search.plan import planned_rounds

SEARCH_THREADS = CORES if SEARCH and not FLIGHT_BY_FLIGHT else 1
KEPT_PAIRS = placed("results/tried")


if SEARCH:
    ROUNDS = planned_rounds(SEARCH)
    SEARCH_SETTINGS = {
        "decision": asdict(SETTINGS.decision) | {"seed": SETTINGS.seed},
        "replay": asdict(SETTINGS.replay),
        "scoring": asdict(SETTINGS.scoring),
        "trust": asdict(SETTINGS.trust),
    }

    checkpoint search_flights:
        input:
            folders=of_replayable_flights("results/save/{flight}"),
            present="results/save/present.json",
            flights="results/save/flights.parquet",
            listed="results/save/flights.csv",
            kernels=KERNELS_READY,
        output:
            "results/search/flights.json",
        log:
            "results/logs/search/flights.log",
        conda:
            "../envs/fusetune.yaml"
        threads: SEARCH_THREADS
        resources:
            mem_mb=of_several_logs(SEARCH_THREADS),
            runtime=of_its_logs(10, 0.02),
        params:
            parameters=SEARCH.parameters,
            settings=SEARCH_SETTINGS,
            code=DIGEST["search"],
        message:
            "Search: find the flights that can be searched on"
        script:
            "../scripts/search_flights.py"

    for number in range(1, ROUNDS + 1):

        rule:
            name:
                f"search_ask_{number}"
            input:
                on="results/search/flights.json",
                asked=asked_before(number),
                tried=tried_before(number),
            output:
                f"results/search/ask_{number}.json",
            log:
                f"results/logs/search/ask_{number}.log",
            localrule: True
            conda:
                "../envs/fusetune.yaml"
            resources:
                mem_mb=2 * LIBRARIES_MB,
                runtime=10,
            params:
                number=number,
                search=asdict(SEARCH),
                settings=SEARCH_SETTINGS,
                code=DIGEST["search"],
            message:
                f"Search: what to try in round {number} of {ROUNDS}"
            script:
                "../scripts/search_ask.py"

        if FLIGHT_BY_FLIGHT:

            rule:
                name:
                    f"search_try_{number}"
                input:
                    folders="results/save/{flight}",
                    asked=f"results/search/ask_{number}.json",
                    kernels=KERNELS_READY,
                output:
                    f"results/search/tried/{number}/{{flight}}.json",
                log:
                    f"results/logs/search/{{flight}}.{number}.log",
                conda:
                    "../envs/fusetune.yaml"
                resources:
                    mem_mb=of_its_logs(KERNELS_MB, SEARCHED_MB_PER_MB),
                    runtime=of_its_logs(10, 0.1),
                params:
                    settings=SEARCH_SETTINGS,
                    kept=KEPT_PAIRS,
                    code=DIGEST["search"],
                message:
                    f"Search: try sets of round {number} of {ROUNDS} on {{wildcards.flight}}"
                script:
                    "../scripts/search_try.py"

        else:

            rule:
                name:
                    f"search_try_{number}"
                input:
                    folders=of_replayable_flights("results/save/{flight}"),
                    on="results/search/flights.json",
                    asked=f"results/search/ask_{number}.json",
                    kernels=KERNELS_READY,
                output:
                    directory(f"results/search/tried/{number}"),
                log:
                    f"results/logs/search/try_{number}.log",
                conda:
                    "../envs/fusetune.yaml"
                threads: SEARCH_THREADS
                resources:
                    mem_mb=of_several_logs(SEARCH_THREADS),
                    runtime=of_its_logs(10, 0.1),
                params:
                    settings=SEARCH_SETTINGS,
                    kept=KEPT_PAIRS,
                    code=DIGEST["search"],
                message:
                    f"Search: try sets of round {number} of {ROUNDS}"
                script:
                    "../scripts/search_try.py"

    rule search_found:
        input:
            on="results/search/flights.json",
            present="results/save/present.json",
            asked=asked_before(ROUNDS + 1),
            tried=tried_before(ROUNDS + 1),
        output:
            found="results/search/found.json",
            trials="results/search/trials.json",
            sensitivity="results/search/sensitivity.json",
        log:
            "results/logs/search/found.log",
        localrule: True
        conda:
            "../envs/fusetune.yaml"
        resources:
            mem_mb=2 * LIBRARIES_MB,
            runtime=10,
        params:
            rounds=ROUNDS,
            search=asdict(SEARCH),
            settings=SEARCH_SETTINGS,
            code=DIGEST["search"],
        message:
            "Search: what was found"
        script:
            "../scripts/search_found.py"
