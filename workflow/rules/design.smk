rule design:
    input:
        study=as_named(INPUTS.study_file),
        mission=as_named(SETTINGS.mission),
        # what it says comes in as a parameter, so that only other sets make anything again; asked for by a function, as
        # Snakemake plans a job anew behind a checkpoint only where its input waits for that
        present=ancient(lambda wildcards: checkpoints.list_flights.get().output.present if SETS.around else []),
    output:
        plan=f"results/design/{INPUTS.mission.name}.plan",
        sets=report(
            "results/design/sets.parquet",
            caption="../report/sets.rst",
            category=DESIGN_STEP,
            labels={"table": "parameter sets"},
        ),
        params=expand("results/design/{pset}.params", pset=list(SETS.study)),
        around=[directory("results/design/around_present")] if SETS.around else [],
    log:
        "results/logs/design.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB),
        runtime=of_its_logs(5),
    params:
        contents=contents(INPUTS.study_file, SETTINGS.mission),
        around=lambda wildcards: asdict(present_found())["sets"] if SETS.around else (),
        release=SETTINGS.release,
        code=DIGEST["design"],
    message:
        f"Design: write the mission plan and {INPUTS.study.name}'s parameter sets"
    script:
        "../scripts/design.py"


rule mission_map:
    input:
        mission=as_named(SETTINGS.mission),
        vehicle=list(map(as_named, MISSION_VEHICLE)),
    output:
        map=report(
            f"results/design/{INPUTS.mission.name}.svg",
            caption="../report/mission.rst",
            category=DESIGN_STEP,
            labels={"figure": "mission"},
        ),
        outlook=f"results/design/{INPUTS.mission.name}.json",
    log:
        "results/logs/mission_map.log",
    localrule: True
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB),
        runtime=of_its_logs(5),
    params:
        contents=contents(SETTINGS.mission, *MISSION_VEHICLE),
        code=DIGEST["mission"],
    message:
        "Design: plan the flight of the mission, draw its map"
    script:
        "../scripts/mission_map.py"
