# Made when asked for, `snakemake covariances`: no decision rests on it.
rule covariance_design:
    input:
        design=lambda wildcards: design_files(wildcards)[0],
        named=lambda wildcards: design_files(wildcards)[1:],
        kernels=KERNELS_READY,
    output:
        directory("results/design/covariance/{design}"),
    log:
        "results/logs/covariance/{design}.log",
    conda:
        "../envs/fusetune.yaml"
    resources:
        mem_mb=KERNELS_MB + 200,
        runtime=30,
    params:
        contents=lambda wildcards: contents(*design_files(wildcards))(wildcards),
        code=DIGEST["covariance"],
    message:
        "Design: the covariances of {wildcards.design}"
    script:
        "../scripts/covariance_design.py"


rule covariances:
    input:
        expand("results/design/covariance/{design}", design=list(DESIGNS)),
    localrule: True
    resources:
        mem_mb=LIBRARIES_MB,
        runtime=5,
