# Whoever needs it must not ask for it as `ancient`: where this rule runs though its output is there (its script is
# newer), Snakemake 9.27 would leave out, without a word, everything that is only behind such an input.
rule compile_kernels:
    output:
        KERNELS_READY,
    log:
        "results/logs/compile_kernels.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(1500),
        runtime=of_its_logs(30),
    message:
        "Compile the estimator (once for each version of its sources)"
    script:
        "../scripts/compile_kernels.py"


rule simulate_flight:
    input:
        mission=as_named(SETTINGS.mission),
        vehicle=as_named(SETTINGS.demonstration.vehicle),
        kernels=KERNELS_READY,
    output:
        "results/execute/{flight}.ulg",
    log:
        "results/logs/execute/{flight}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=of_its_logs(KERNELS_MB, 15.0),
        runtime=of_its_logs(10, 0.5),
    params:
        overrides=lambda wildcards: SETS.study[INPUTS.simulated[wildcards.flight]],
        faults=lambda wildcards: SETTINGS.demonstration.faults.get(wildcards.flight, ()),
        seed=lambda wildcards: 1000 * SETTINGS.demonstration.seed + list(INPUTS.simulated).index(wildcards.flight) + 1,
        contents=contents(SETTINGS.mission, SETTINGS.demonstration.vehicle),
        code=DIGEST["execute"],
    message:
        "Execute: simulate {wildcards.flight}"
    script:
        "../scripts/simulate_flight.py"
