# The three steps of a cell.

CELL = f"{RESULTS}/cells/{CELLS.wildcard_pattern}"


rule select:
    input:
        scene=f"{RESULTS}/scenes/{{scene}}.json",
        features=WIRING.features,
        sources=WIRING.selector_sources,
    output:
        f"{CELL}/selection.json",
    log:
        f"{RESULTS}/logs/select/{CELLS.wildcard_pattern}.log",
    params:
        selector=lambda wildcards: STUDY.selector(wildcards.selector).selector,
        options=WIRING.selector_options,
    message:
        "select {wildcards.scene}: {wildcards.selector}, ratio {wildcards.ratio}, seed {wildcards.seed}"
    shell:
        "viewbench select {wildcards.scene:q} --selector {params.selector:q} --ratio {wildcards.ratio}"
        " --seed {wildcards.seed} {params.options} --selection {output:q} > /dev/null 2> {log:q}"


rule train:
    input:
        scene=f"{RESULTS}/scenes/{{scene}}.json",
        selection=f"{CELL}/selection.json",
        warm=f"{RESULTS}/warm/{{backend}}",
        sources=WIRING.backend_sources,
    output:
        f"{CELL}/train.json",
    log:
        f"{RESULTS}/logs/train/{CELLS.wildcard_pattern}.log",
    benchmark:
        f"{RESULTS}/benchmarks/train/{CELLS.wildcard_pattern}.tsv"
    threads: SETTINGS.compute.threads
    resources:
        gpu=WIRING.gpu,
    params:
        folder=subpath(output[0], parent=True),
        backend=lambda wildcards: STUDY.backend(wildcards.backend).backend,
        options=WIRING.backend_options,
    message:
        "train {wildcards.scene}: {wildcards.selector}, ratio {wildcards.ratio}, seed {wildcards.seed}, {wildcards.backend}"
    shell:
        "viewbench train {wildcards.scene:q} --selection {input.selection:q} --backend {params.backend:q}"
        " --seed {wildcards.seed} {params.options} --out {params.folder:q} > /dev/null 2> {log:q}"


rule evaluate:
    input:
        scene=f"{RESULTS}/scenes/{{scene}}.json",
        train=f"{CELL}/train.json",
        sources=WIRING.sources("evaluate", "workflow.commands.evaluate"),
    output:
        f"{CELL}/metrics.json",
    log:
        f"{RESULTS}/logs/evaluate/{CELLS.wildcard_pattern}.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate/{CELLS.wildcard_pattern}.tsv"
    # A cell that is trained is scored before the next one starts, so that results come in as the study runs.
    priority: 10
    threads: SETTINGS.compute.threads
    resources:
        gpu=WIRING.gpu,
    params:
        folder=subpath(output[0], parent=True),
    message:
        "evaluate {wildcards.scene}: {wildcards.selector}, ratio {wildcards.ratio}, seed {wildcards.seed}, {wildcards.backend}"
    shell:
        "viewbench evaluate {params.folder:q} {wildcards.scene:q} --out {params.folder:q} > /dev/null 2> {log:q}"
