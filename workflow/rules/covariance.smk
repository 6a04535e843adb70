# Made when asked for, `snakemake covariances`: no decision rests on it.
from fusetune.design.covariance.named_files import files_of_design

DESIGNS = {Path(file).stem: file for file in SETTINGS.covariance_designs}
"""Name of a design → its file."""


def design_files(wildcards):
    return told_in_one_line(files_of_design, DESIGNS[wildcards.design])


rule covariance_design:
    input:
        design=lambda wildcards: DESIGNS[wildcards.design],
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
    resources:
        mem_mb=LIBRARIES_MB,
        runtime=5,
