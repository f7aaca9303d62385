# The steps of a cell: a choice, which several cells may share, a model and its score.
#
# Priorities say what goes first where several jobs could: what others wait for (kernels), then what is nearest to a
# result. So a cell whose choice is made is trained before further choices are made, and scored when it is trained;
# results come in from the first minute on. What selectors with features wait for holds up no other selector's cells.

CELL = f"{RESULTS}/cells/{AXES}"


rule select:
    input:
        scene=WIRING.scene,
        features=WIRING.features,
        warm=WIRING.warm_selector,
        depends=WIRING.choosing,
    output:
        f"{RESULTS}/selections/{{scene}}/{{selector}}/{{part}}/{{seed}}.json",
    log:
        f"{RESULTS}/logs/select/{{scene}}/{{selector}}/{{part}}/{{seed}}.log",
    priority: 20
    resources:
        mem_mb=NEEDS.select_mb,
        runtime=NEEDS.select_minutes,
    params:
        selector=lambda wildcards: STUDY.selector(wildcards.selector).selector,
        options=WIRING.selector_options,
    message:
        "select {wildcards.scene}: {wildcards.selector}, ratio {wildcards.part}, seed {wildcards.seed}"
    shell:
        "viewbench select {wildcards.scene:q} --selector {params.selector:q} --ratio {wildcards.part}"
        " --seed {wildcards.seed} {params.options} --selection {output:q} > /dev/null 2> {log:q}"


rule train:
    input:
        scene=WIRING.scene,
        selection=WIRING.selection,
        warm=WIRING.warm,
        depends=WIRING.training,
    output:
        train=f"{CELL}/train.json",
        selection=f"{CELL}/selection.json",
    log:
        f"{RESULTS}/logs/train/{AXES}.log",
    benchmark:
        f"{RESULTS}/benchmarks/train/{AXES}.tsv"
    priority: 40
    threads: SETTINGS.compute.threads
    resources:
        mem_mb=NEEDS.train_mb,
        runtime=NEEDS.train_minutes,
        gpu=WIRING.gpu,
    params:
        folder=subpath(output.train, parent=True),
        backend=lambda wildcards: STUDY.backend(wildcards.backend).backend,
        options=WIRING.backend_options,
    message:
        "train {wildcards.scene}: {wildcards.selector}, ratio {wildcards.ratio}, seed {wildcards.seed}, {wildcards.backend}"
    shell:
        "viewbench train {wildcards.scene:q} --selection {input.selection:q} --ratio {wildcards.ratio}"
        " --backend {params.backend:q} --seed {wildcards.seed} {params.options} --out {params.folder:q}"
        " > /dev/null 2> {log:q}"


rule evaluate:
    input:
        scene=WIRING.scene,
        train=f"{CELL}/train.json",
        depends=WIRING.scoring,
    output:
        f"{CELL}/metrics.json",
    log:
        f"{RESULTS}/logs/evaluate/{AXES}.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate/{AXES}.tsv"
    priority: 50
    threads: SETTINGS.compute.threads
    resources:
        mem_mb=NEEDS.evaluate_mb,
        runtime=NEEDS.evaluate_minutes,
        gpu=WIRING.gpu,
    params:
        folder=subpath(output[0], parent=True),
    message:
        "evaluate {wildcards.scene}: {wildcards.selector}, ratio {wildcards.ratio}, seed {wildcards.seed}, {wildcards.backend}"
    shell:
        "viewbench evaluate {params.folder:q} {wildcards.scene:q} --out {params.folder:q} > /dev/null 2> {log:q}"
