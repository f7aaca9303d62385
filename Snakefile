# The entry, so that `snakemake -j2 reports` works from a clone; the workflow itself is in workflow/.
include: "workflow/Snakefile"


# A rule of an included file is never the default; this one is what `snakemake` makes without a target.
rule all:
    default_target: True
    input:
        rules.reports.input,
    localrule: True
