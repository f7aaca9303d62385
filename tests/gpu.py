"""Everything that needs a GPU, in one go of some ten minutes: `make gpu`, or `python -m tests.gpu [--real]`.

The backend suite on gsplat, gsplat's kernels against splat's, and the study `gpu` with both, and with instant-ngp where
environment.toml names a checkout; with --real the study `gpu-real` too, where its capture is. Then a table, and a
recording of each study with machine and versions. Where there is no GPU it says so in one sentence, and what no GPU has
tried is not said to work.
"""

import csv
import platform
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from viewbench.backends import _registry
from viewbench.common import gpu
from viewbench.common import settings as settings_file
from viewbench.common.cells import cell_folder
from viewbench.common.files import read_json
from viewbench.common.settings import PACKAGE
from viewbench.reports._statistics import summary
from viewbench.workflow import _study
from viewbench.workflow.commands import run

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
    began = time.monotonic()
    if _run("-m", "viewbench", "warm", "--backend", "gsplat"):
        return 1
    print(f"gsplat's CUDA code is there after {time.monotonic() - began:.0f} s")
    status = _run("-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", _tests(reasons), *SUITE)
    for study in STUDIES if "--real" in sys.argv else STUDIES[:1]:
        if not _has_scenes(study, settings):
            print(f"study {study}: its capture is not here; set VIEWBENCH_DATA to the folder of captures")
            continue
        file = _with_instant_ngp(study) if reasons["instant-ngp"] is None else study
        status |= _run("-m", "snakemake", "-j2", "--config", f"study={file}", "--", "reports")
        results = Path("results") / study
        if (results / "results.csv").is_file():
            print("\n".join(table(results)))
            note = "made by make gpu"
            status |= _run("-m", "viewbench", "record", str(results), "--name", study, "--note", note)
    return int(status != 0)


def _with_instant_ngp(study: str) -> str:
    """A file of the study with instant-ngp among its backends, of the same name."""
    text = (_study.STUDIES / f"{study}.yaml").read_text(encoding="utf-8")
    line = "  - {backend: instant-ngp, budget: {iterations: 5000}}\n"
    file = PACKAGE / "results" / f"{study}.yaml"
    file.parent.mkdir(exist_ok=True)
    file.write_text(text.replace("backends:\n", "backends:\n" + line), encoding="utf-8")
    return str(file)


def _tests(reasons: dict[str, str | None]) -> str:
    usable = [name for name, reason in reasons.items() if reason is None]
    return " or ".join([*usable, "cuda", "cpu_backend"])


def _run(*arguments: str) -> int:
    print("$ python", *arguments, flush=True)
    environment = run.environment(settings_file.load())
    return subprocess.run([sys.executable, *arguments], cwd=PACKAGE, env=environment).returncode


def _has_scenes(study: str, settings: settings_file.Settings) -> bool:
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
        record = read_json(cell_folder(results, rows[0]) / "train.json")
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
