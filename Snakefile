# The entry, so that `snakemake -j2 reports` works from a clone; the workflow itself is in workflow/.
include: "workflow/Snakefile"
