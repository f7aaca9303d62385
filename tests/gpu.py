"""Everything that needs a GPU, in one go of some ten minutes: `make gpu`, or `python -m tests.gpu`.

The backend suite on gsplat, gsplat's kernels against splat's, the study `gpu` (and `gpu-real` where its capture is)
with both, instant-ngp where environment.toml names a checkout; then a table, and a recording of each study with machine
and versions. Where there is no GPU it says so in one sentence, and what no GPU has tried is not said to work.
"""

import csv
import os
import platform
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from viewbench.backends import _registry
from viewbench.common import gpu
from viewbench.common import settings as settings_file
from viewbench.common.files import read_json
from viewbench.common.settings import PACKAGE
from viewbench.reports._statistics import summary

SUITE = ("tests/backends/test_every_backend.py", "tests/backends/gsplat")
STUDIES = ("gpu", "gpu-real")


def main() -> int:
    """Runs what can be run; the exit status is 1 when something that can be run fails, 0 also where there is no GPU."""
    devices = gpu.devices()
    if not devices:
        print(
            "No GPU is in reach (nvidia-smi names none, or CUDA_VISIBLE_DEVICES hides them), so nothing was tried; "
            "gsplat and instant-ngp are as unproven here as before."
        )
        return 0
    settings = settings_file.load()
    print(f"{len(devices)} GPU{'s' if len(devices) > 1 else ''}; {platform.processor() or platform.machine()}")
    reasons = {name: _registry.load(name, settings).available() for name in ("gsplat", "instant-ngp")}
    for name, reason in reasons.items():
        print(f"{name}: {reason or _registry.load(name, settings).version()}")
    if reasons["gsplat"]:
        return 1
    status = _run("-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", _tests(reasons), *SUITE)
    for study in STUDIES:
        if not _has_scenes(study, settings):
            print(f"study {study}: its capture is not here; set VIEWBENCH_DATA to the folder of captures")
            continue
        status |= _run("-m", "snakemake", "-j2", "--config", f"study={study}", "--", "reports")
        results = Path("results") / study
        if (results / "results.csv").is_file():
            print("\n".join(table(results)))
            note = "made by make gpu"
            status |= _run("-m", "viewbench", "record", str(results), "--name", study, "--note", note)
    return int(status != 0)


def _tests(reasons: dict[str, str | None]) -> str:
    usable = [name for name, reason in reasons.items() if reason is None]
    return " or ".join([*usable, "cuda", "cpu_backend"])


def _run(*arguments: str) -> int:
    print("$ python", *arguments, flush=True)
    return subprocess.run(
        [sys.executable, *arguments], cwd=PACKAGE, env={**os.environ, "OMP_NUM_THREADS": "1"}
    ).returncode


def _has_scenes(study: str, settings: settings_file.Settings) -> bool:
    from viewbench.workflow import _study

    def there(name: str) -> bool:
        path = settings.scenes[name].path
        return path.startswith("package:") or Path(settings.data.root, path).is_dir()

    return all(there(name) for name in _study.load(study, settings).scenes)


def table(results: Path) -> Iterable[str]:
    """Lines of Markdown: what each backend reached, with what, in how long."""
    groups = defaultdict(list)
    with open(results / "results.csv", newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["status"] == "ok":
                groups[row["scene"], row["backend"], row["selector"], row["ratio"]].append(row)
    yield "| scene | backend | selector | ratio | PSNR (dB, ± s.d.) | train (s) | GPU memory (MB) | device | shared |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for key, rows in groups.items():
        psnr = summary([float(row["psnr_db"]) for row in rows])
        seconds = summary([float(row["train_s"]) for row in rows]).mean
        folder = results.joinpath(
            "cells", *(rows[0][name] for name in ("backend", "scene", "selector", "ratio", "seed"))
        )
        record = read_json(folder / "train.json")
        memory = record["peak_gpu_bytes"]
        spread = "" if psnr.std is None else f" ± {psnr.std:.2f}"
        shared = {True: "yes", False: "no", None: "unknown"}[record["gpu"]["shared"]] if record["gpu"] else ""
        cells = [
            f"{psnr.mean:.2f}{spread}",
            f"{seconds:.1f}",
            f"{memory / 1e6:.0f}" if memory else "",
            record["device"],
        ]
        yield f"| {' | '.join([*key, *cells, shared])} |"


if __name__ == "__main__":
    sys.exit(main())
