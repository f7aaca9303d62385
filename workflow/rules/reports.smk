# What is done with the finished cells.

METRICS = expand(f"{RESULTS}/cells/{{cell}}/metrics.json", cell=CELLS)


rule collect:
    input:
        cells=METRICS,
        scenes=expand(f"{RESULTS}/scenes/{{scene}}.json", scene=STUDY.scenes),
        study=f"{RESULTS}/study.json",
        depends=WIRING.command("collect"),
    output:
        f"{RESULTS}/results.csv",
    log:
        f"{RESULTS}/logs/collect.log",
    localrule: True
    params:
        study=GIVEN,
        results=Path(RESULTS).parent,
    message:
        "gather the cells into results.csv"
    shell:
        "viewbench collect {params.study:q} --results {params.results:q} > /dev/null 2> {log:q}"


# What the process that follows the run (_tracker.py) has not logged, and the summaries. The page says whether that worked.
rule track:
    input:
        results=f"{RESULTS}/results.csv",
        depends=WIRING.command("track"),
    output:
        f"{RESULTS}/tracked.json",
    log:
        f"{RESULTS}/logs/track.log",
    priority: 10  # the longest of what is done at the end
    localrule: True
    params:
        study=GIVEN,
        results=Path(RESULTS).parent,
        tracking=WIRING.tracking,
    message:
        "log the cells to MLflow"
    shell:
        "viewbench track {params.study:q} --results {params.results:q} --only cells --stamp {output:q}"
        " > /dev/null 2> {log:q}"


rule report:
    input:
        f"{RESULTS}/results.csv",
        f"{RESULTS}/study.json",
        WIRING.report,
    output:
        f"{RESULTS}/reports/{{report}}.items.json",
    log:
        f"{RESULTS}/logs/report/{{report}}.log",
    localrule: True
    params:
        folder=subpath(output[0], ancestor=2),
    message:
        "draw {wildcards.report}"
    shell:
        "viewbench report {params.folder:q} --only {wildcards.report:q} > /dev/null 2> {log:q}"


rule page:
    input:
        expand(f"{RESULTS}/reports/{{report}}.items.json", report=STUDY.reports),
        f"{RESULTS}/tracked.json",
        WIRING.page,
    output:
        f"{RESULTS}/reports/index.html",
    log:
        f"{RESULTS}/logs/report/page.log",
    localrule: True
    params:
        folder=subpath(output[0], ancestor=2),
    message:
        "put the page together"
    shell:
        "viewbench report {params.folder:q} --page > /dev/null 2> {log:q}"


rule publish:
    input:
        page=f"{RESULTS}/reports/index.html",
        tracked=f"{RESULTS}/tracked.json",
        depends=WIRING.command("track"),
    output:
        f"{RESULTS}/published.json",
    log:
        f"{RESULTS}/logs/publish.log",
    localrule: True
    params:
        study=GIVEN,
        results=Path(RESULTS).parent,
        tracking=WIRING.tracking,
    message:
        "put the page into MLflow"
    shell:
        "viewbench track {params.study:q} --results {params.results:q} --only page --stamp {output:q}"
        " > /dev/null 2> {log:q}"
