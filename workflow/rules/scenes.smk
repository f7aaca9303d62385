# What is done once a scene, and once a study.


rule study:
    input:
        WIRING.study_file,
    output:
        f"{RESULTS}/study.json",
    log:
        f"{RESULTS}/logs/study.log",
    priority: 100
    localrule: True
    params:
        study=GIVEN,
    message:
        "check the study file"
    shell:
        "viewbench study {params.study:q} --out {output:q} 2> {log:q}"


# Generated rooms that are not there (`render` in environment.toml), drawn by Blender in parts that share the frames. What
# needs the scene is planned when it is there, since all of it goes by the scene's hash.
rule render:
    output:
        touch(f"{RESULTS}/rendered/{{scene}}/{{piece}}"),
    log:
        f"{RESULTS}/logs/render/{{scene}}/{{piece}}.log",
    priority: 80
    resources:
        mem_mb=NEEDS.fixed(6000),
        runtime=NEEDS.fixed(240),
    params:
        command=WIRING.render_command,
        part=WIRING.render_part,
    message:
        "render {wildcards.scene}, {wildcards.piece}"
    shell:
        "{params.command} {params.part} > /dev/null 2> {log:q}"


checkpoint rendered:
    input:
        WIRING.render_parts,
    output:
        f"{RESULTS}/rendered/{{scene}}.txt",
    log:
        f"{RESULTS}/logs/render/{{scene}}.log",
    priority: 80
    resources:
        mem_mb=NEEDS.fixed(2000),
        runtime=NEEDS.fixed(60),
    params:
        command=WIRING.render_command,
    message:
        "all of {wildcards.scene} is rendered"
    shell:
        "{params.command} > {output:q} 2> {log:q} || {{ rm -f {output:q}; exit 1; }}"


WIRING.checkpoints = checkpoints


# For the reports; no selection, model or score depends on it.
rule describe:
    input:
        scene=WIRING.scene,
        depends=WIRING.command("describe"),
    output:
        f"{RESULTS}/scenes/{{scene}}.json",
    log:
        f"{RESULTS}/logs/describe/{{scene}}.log",
    priority: 30  # it takes a second, and a study that was stopped is reported with it
    resources:
        mem_mb=NEEDS.describe_mb,
        runtime=NEEDS.fixed(15),
    params:
        width=WIRING.truth_width,
        dataset=WIRING.dataset,
        room=WIRING.room,
        walk=WIRING.walk,
        seen=WIRING.seen,
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
    priority: 10
    threads: SETTINGS.compute.threads
    resources:
        mem_mb=NEEDS.features_mb,
        runtime=NEEDS.features_minutes,
        gpu=WIRING.encoder_gpu,
    params:
        encoder=STUDY.encoder,
    message:
        "features of {wildcards.scene}"
    shell:
        "viewbench features {wildcards.scene:q} --encoder {params.encoder:q} --out {output:q} > /dev/null 2> {log:q}"


# These two run again exactly when the trainings, and the selections, do that wait for them. What a study calls by two
# names is compiled once.
rule warm:
    input:
        WIRING.training_compiled,
    output:
        touch(f"{RESULTS}/warm/{{trainer}}"),
    log:
        f"{RESULTS}/logs/warm/{{trainer}}.log",
    priority: 100
    # CUDA code is compiled for the device that is there.
    resources:
        mem_mb=NEEDS.fixed(4000),
        runtime=NEEDS.fixed(30),
        gpu=WIRING.warm_gpu,
    params:
        backend=lambda wildcards: WIRING.trainers[wildcards.trainer],
    message:
        "prepare backend {wildcards.trainer}"
    shell:
        "viewbench warm --backend {params.backend:q} 2> {log:q}"


rule warm_selector:
    input:
        WIRING.choosing_compiled,
    output:
        touch(f"{RESULTS}/warm_selectors/{{plugin}}"),
    log:
        f"{RESULTS}/logs/warm_selectors/{{plugin}}.log",
    priority: 90
    resources:
        mem_mb=NEEDS.fixed(2000),
        runtime=NEEDS.fixed(15),
    message:
        "prepare selector {wildcards.plugin}"
    shell:
        "viewbench warm --selector {wildcards.plugin:q} 2> {log:q}"
