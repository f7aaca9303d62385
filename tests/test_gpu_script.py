"""`make gpu` where there is no GPU, and where there is one that gsplat cannot use."""

import json
import os
import subprocess
import sys
from pathlib import Path

from tests import gpu as script
from viewbench.common import settings as settings_file
from viewbench.common.settings import PACKAGE


def run(path: Path) -> subprocess.CompletedProcess:
    environment = {name: value for name, value in os.environ.items() if name != "CUDA_VISIBLE_DEVICES"}
    environment["PATH"] = str(path)
    command = [sys.executable, "-m", "tests.gpu"]
    return subprocess.run(command, cwd=PACKAGE, env=environment, capture_output=True, text=True, timeout=120)


def test_without_a_gpu_it_is_one_sentence(tmp_path):
    done = run(tmp_path)
    assert (done.returncode, done.stdout.count("\n"), done.stderr) == (0, 1, "")
    assert done.stdout.startswith("No GPU is in reach")


def test_a_gpu_that_gsplat_cannot_use_is_a_failure_with_its_reason(tmp_path):
    tool = tmp_path / "nvidia-smi"
    tool.write_text('#!/bin/sh\necho "0, GPU-aa"\n')
    tool.chmod(0o755)
    done = run(tmp_path)
    assert done.returncode == 1, done.stdout
    assert "1 GPU;" in done.stdout
    assert "instant-ngp: no checkout is configured" in done.stdout
    assert "CUDA" in done.stdout


def test_a_study_whose_capture_is_away_is_left_out(tmp_path, monkeypatch):
    monkeypatch.setenv("VIEWBENCH_DATA", str(tmp_path))
    settings = settings_file.load()
    assert script._has_scenes("gpu", settings)
    assert not script._has_scenes("gpu-real", settings)
    (tmp_path / "hololens_space").mkdir()
    assert script._has_scenes("gpu-real", settings)


def test_the_table_has_a_line_for_each_way_of_choosing(tmp_path):
    rows = ["scene,backend,selector,ratio,seed,status,psnr_db,train_s"]
    for seed, psnr in enumerate((20.0, 22.0)):
        rows.append(f"room,gsplat,maxmin,0.05,{seed},ok,{psnr},30")
    rows.append("room,gsplat,maxmin,0.05,2,failed,,")
    (tmp_path / "results.csv").write_text("\n".join(rows))
    cell = tmp_path / "cells" / "gsplat" / "room" / "maxmin" / "0.05" / "0"
    cell.mkdir(parents=True)
    about = {"device": "some GPU", "peak_gpu_bytes": 2_000_000_000, "gpu": {"shared": True}}
    (cell / "train.json").write_text(json.dumps(about))
    line = list(script.table(tmp_path))[2]
    assert line == "| room | gsplat | maxmin | 0.05 | 21.00 ± 1.41 | 30.0 | 2000 | some GPU | yes |"
