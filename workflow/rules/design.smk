rule design:
    input:
        study=SETTINGS.study,
        mission=SETTINGS.mission,
    output:
        plan=f"results/design/{INPUTS.mission.name}.plan",
        sets=report(
            "results/design/sets.parquet",
            caption="../report/sets.rst",
            category="Design",
            labels={"table": "parameter sets"},
        ),
        params=expand("results/design/{pset}.params", pset=list(SETS.study)),
    log:
        "results/logs/design.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(LIBRARIES_MB),
        runtime=of_its_logs(5),
    params:
        contents=contents(SETTINGS.study, SETTINGS.mission),
        code=DIGEST["design"],
    message:
        "Design: write the mission plan and {INPUTS.study.name}'s parameter sets"
    script:
        "../scripts/design.py"
