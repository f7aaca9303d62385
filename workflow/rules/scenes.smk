# What is done once a scene, and once a study.


rule study:
    input:
        WIRING.study_file,
    output:
        f"{RESULTS}/study.json",
    log:
        f"{RESULTS}/logs/study.log",
    localrule: True
    params:
        study=GIVEN,
    message:
        "check the study file"
    shell:
        "viewbench study {params.study:q} --out {output:q} 2> {log:q}"


# For the reports; no selection, model or score depends on it.
rule describe:
    input:
        scene=WIRING.scene,
        depends=WIRING.command("describe"),
    output:
        f"{RESULTS}/scenes/{{scene}}.json",
    log:
        f"{RESULTS}/logs/describe/{{scene}}.log",
    params:
        width=WIRING.truth_width,
        dataset=WIRING.dataset,
    message:
        "describe {wildcards.scene}"
    shell:
        "viewbench describe {wildcards.scene:q} --width {params.width} --out {output:q} 2> {log:q}"


rule features:
    input:
        scene=WIRING.scene,
        depends=WIRING.encoder,
    output:
        f"{RESULTS}/features/{{scene}}.npy",
    log:
        f"{RESULTS}/logs/features/{{scene}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/features/{{scene}}.tsv"
    threads: SETTINGS.compute.threads
    resources:
        gpu=WIRING.encoder_gpu,
    params:
        encoder=STUDY.encoder,
    message:
        "features of {wildcards.scene}"
    shell:
        "viewbench features {wildcards.scene:q} --encoder {params.encoder:q} --out {output:q} > /dev/null 2> {log:q}"


# These two run again exactly when the trainings, and the selections, do that wait for them.
rule warm:
    input:
        WIRING.training,
    output:
        touch(f"{RESULTS}/warm/{{backend}}"),
    log:
        f"{RESULTS}/logs/warm/{{backend}}.log",
    params:
        backend=lambda wildcards: STUDY.backend(wildcards.backend).backend,
    message:
        "prepare backend {wildcards.backend}"
    shell:
        "viewbench warm --backend {params.backend:q} 2> {log:q}"


rule warm_selector:
    input:
        WIRING.choosing_compiled,
    output:
        touch(f"{RESULTS}/warm_selectors/{{plugin}}"),
    log:
        f"{RESULTS}/logs/warm_selectors/{{plugin}}.log",
    message:
        "prepare selector {wildcards.plugin}"
    shell:
        "viewbench warm --selector {wildcards.plugin:q} 2> {log:q}"
