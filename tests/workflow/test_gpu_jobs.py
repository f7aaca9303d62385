"""A study on a machine with two GPUs that do not exist: three jobs at once, and never two on one device."""

import json
import os
import sys

from tests.workflow.clones import Clone

STUDY = """
scenes: [room_human]
selectors: [uniform]
ratios: [0.01, 0.02, 0.03]
seeds: 2
backends: [command:tool]
budget: {iterations: 1}
width: 16
reference: false
reports: [timing]
"""
TRAIN = """
import os, pathlib, sys, time
device, began = os.environ["CUDA_VISIBLE_DEVICES"], time.monotonic()
place = pathlib.Path(sys.argv[1])
(place / f"{os.getpid()}.started").touch()
while len(list(place.glob("*.started"))) < 2 and time.monotonic() < began + 120:
    time.sleep(0.05)  # the first two wait for each other
time.sleep(0.3)
open("model", "w").write("x")
with open(sys.argv[1] + "/log", "a") as log:
    log.write(f"{device} {began} {time.monotonic()}\\n")
"""
SMI = """#!/bin/sh
case "$1" in
    *index,uuid*) printf "0, GPU-aa\\n1, GPU-bb\\n" ;;
    *gpu_uuid,pid*) echo "GPU-bb, 1" ;;
esac
"""
RENDER = "import shutil, sys; shutil.copytree(sys.argv[1] + '/images', sys.argv[2], dirs_exist_ok=True)"


def test_three_jobs_on_two_devices(tmp_path):
    clone = Clone(tmp_path, STUDY)
    log = tmp_path / "log"
    tool = tmp_path / "bin" / "nvidia-smi"
    tool.parent.mkdir()
    tool.write_text(SMI)
    tool.chmod(0o755)
    for name, code in (("train.py", TRAIN), ("render.py", RENDER)):
        (tmp_path / name).write_text(code)
    train = [sys.executable, str(tmp_path / "train.py"), str(tmp_path), "{iterations}"]
    render = [sys.executable, str(tmp_path / "render.py"), "{cameras}", "{renders}"]
    (clone.folder / "environment.toml").write_text(
        '[scenes.room_human]\npath = "package:scenes/generated_room/human"\n[tracking]\nuri = ""\n'
        f'[command.tool]\ndevice = "cuda"\ntrain = {json.dumps(train)}\nrender = {json.dumps(render)}\n'
    )
    (tmp_path / "tmp").mkdir()
    path = f"{tool.parent}{os.pathsep}{clone.environment()['PATH']}"
    variables = {"PATH": path, "TMPDIR": str(tmp_path / "tmp")}
    variables |= {"CUDA_VISIBLE_DEVICES": "0,1"}
    done = clone.call("snakemake", "-j3", "--config", "study=mini", "--", "reports", **variables)
    assert done.returncode == 0, done.stdout + done.stderr
    runs = [line.split() for line in log.read_text().splitlines()]
    assert len(runs) == 6
    spans = [(device, float(began), float(ended)) for device, began, ended in runs]
    together = 0
    for number, (device, began, ended) in enumerate(spans):
        for other, start, end in spans[number + 1 :]:
            if began < end and start < ended:
                together += 1
                assert device != other, "two jobs on one device"
    assert together, "both devices were used at once"
    assert {device for device, _, _ in spans} == {"0", "1"}
    records = [json.loads(path.read_text()) for path in clone.results.rglob("train.json")]
    assert {(record["gpu"]["device"], record["gpu"]["shared"]) for record in records} == {("0", False), ("1", True)}
    assert max(record["gpu"]["waited_s"] for record in records) < 0.5, (
        "Snakemake starts no more jobs than there are GPUs"
    )
    page = (clone.results / "reports" / "index.html").read_text(encoding="utf-8")
    shared = sum(record["gpu"]["shared"] for record in records)
    assert f"{shared} of 6 models were trained on a GPU that other programs used too" in page
