"""A finished study made up for tests: true cameras of the generated room, invented scores and tiny pictures."""

import csv
import json
from pathlib import Path

import numpy as np
from PIL import Image
from plyfile import PlyData

import viewbench
from viewbench.workflow._collect import COLUMNS

ROOM = Path(viewbench.__file__).parent / "scenes" / "generated_room"
SELECTORS = ("random", "uniform", "coverage", "logdet", "maxmin")
GAIN_DB = {"random": -0.5, "uniform": 0.0, "coverage": -1.1, "logdet": 0.2, "maxmin": 0.6}


def make_study(
    root,
    *,
    name="fake",
    title="A study made up for tests",
    scenes=("room_human", "room_smooth"),
    selectors=SELECTORS,
    ratios=(0.05, 0.1, 0.2),
    seeds=(0, 1, 2),
    backends=("splat",),
    reference=True,
    grids=None,
    everything_repeats=False,
    lpips=False,
    truth=True,
    failed=(),
    reports=("psnr-over-ratio", "table-psnr", "cameras", "renders", "timing", "recorded", "published"),
    test_names=None,
):
    """Writes results/NAME under `root` and returns it.

    `grids` holds, by backend, the part of the grid that it runs. With `everything_repeats` coverage and the full-data
    reference have every seed, else one. `failed` holds (backend, scene, selector, ratio, seed) of cells without files;
    a None in it matches anything.
    """
    folder = Path(root) / "results" / name
    folder.mkdir(parents=True)
    _write(
        folder / "study.json",
        _study(name, title, scenes, selectors, ratios, seeds, backends, reference, reports, grids or {}),
    )
    rows = []
    for scene in scenes:
        cameras = _scene(folder, scene, truth, test_names)
        for backend in backends:
            grid = [
                (selector, ratio, seed)
                for selector in selectors
                for ratio in (grids or {}).get(backend, {}).get("ratios", ratios)
                for seed in (seeds[:1] if selector == "coverage" and not everything_repeats else seeds)
            ]
            grid += [("full", 1.0, seed) for seed in (seeds if everything_repeats else (0,))] if reference else []
            for selector, ratio, seed in grid:
                broken = any(
                    all(
                        want is None or want == got
                        for want, got in zip(entry, (backend, scene, selector, ratio, seed), strict=True)
                    )
                    for entry in failed
                )
                cell = (backend, scene, selector, repr(ratio), str(seed))
                rows.append(_cell(folder, name, cell, cameras, lpips, broken))
    with open(folder / "results.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return folder


def _study(name, title, scenes, selectors, ratios, seeds, backends, reference, reports, grids):
    return {
        "schema": 1,
        "name": name,
        "title": title,
        "description": "Scores are invented; cameras are those of the generated room.",
        "scenes": scenes,
        "selectors": [{"name": entry, "selector": entry, "parameters": {}} for entry in selectors],
        "ratios": ratios,
        "seeds": seeds,
        "backends": [
            {
                "name": b,
                "backend": b,
                "iterations": 1500,
                "seconds": None,
                "width": 128,
                "options": {},
                "grid": grids.get(b, {}),
            }
            for b in backends
        ],
        "reference": reference,
        "encoder": "efficientnet-lite0",
        "reports": reports,
    }


def _scene(folder, scene, truth, test_names):
    path = "smooth" if "smooth" in scene else "human"
    splits = {split: json.loads((ROOM / path / f"transforms_{split}.json").read_text()) for split in ("train", "test")}
    record = {"schema": 1, "scene": scene, "dataset": "generated_room", "width": 256, "height": 256, "sha256": "a" * 64}
    for split, content in splits.items():
        poses = np.array([frame["transform_matrix"] for frame in content["frames"]])
        names = [frame["file_path"] for frame in content["frames"]]
        if split == "test" and test_names:
            names[: len(test_names)] = test_names
        record[f"n_{split}"] = len(names)
        record[split] = {
            "names": names,
            "positions": poses[:, :3, 3].round(5).tolist(),
            "forward": (-poses[:, :3, 2]).round(5).tolist(),
        }
    vertices = PlyData.read(ROOM / path / "points3d.ply")["vertex"].data[::10]
    record["points"] = [[round(float(vertex[axis]), 3) for axis in "xyz"] + [128, 128, 128] for vertex in vertices]
    _write(folder / "scenes" / f"{scene}.json", record)
    if truth:
        for number in range(record["n_test"]):
            _picture(folder / "scenes" / scene / f"{number:04d}_view.png", number, 0.0)
    return record


def _cell(folder, study, cell, cameras, lpips, broken):
    backend, scene, selector, ratio, seed = cell
    row = dict.fromkeys(COLUMNS, "") | dict(zip(("backend", "scene", "selector", "ratio", "seed"), cell, strict=True))
    row |= {"study": study, "status": "train: backend 'splat' ran out of memory" if broken else "ok"}
    if broken:
        return row
    rng = np.random.default_rng(abs(int.from_bytes("/".join(cell).encode()[-16:], "big")))
    n_views = cameras["n_train"]
    count = max(1, round(float(ratio) * n_views))
    gain = 0.4 if selector == "full" else GAIN_DB.get(selector, 0.1) * ("smooth" not in scene)
    psnr = 20 + gain + 1.2 * np.log2(1 + 10 * min(float(ratio), 0.25)) + rng.normal(0, 0.15)
    views = [
        {
            "name": view,
            "file": f"renders/{number:04d}_view.png",
            "psnr_db": float(psnr + rng.normal(0, 1)),
            "ssim": float(0.7 + 0.01 * gain),
            "lpips": float(0.3 - 0.01 * gain) if lpips else None,
        }
        for number, view in enumerate(cameras["test"]["names"])
    ]
    indices = rng.permutation(n_views)[:count].tolist()
    at = folder / "cells" / Path(*cell)
    _write(
        at / "selection.json",
        {
            "schema": 1,
            "scene": scene,
            "selector": selector,
            "parameters": {},
            "seed": int(seed),
            "n_views": n_views,
            "count": count,
            "indices": indices,
            "names": [cameras["train"]["names"][index] for index in indices],
            "gains": None,
            "seconds": {"similarity": 0.001, "select": 0.004 + 0.002 * len(selector)},
        },
    )
    seconds = 5.0 + rng.uniform(0, 1)
    curve = [
        {
            "step": step,
            "seconds": seconds * step / 1500,
            "loss": 0.1,
            "test_psnr_db": float(psnr - 6 * np.exp(-step / 300)),
        }
        for step in range(0, 1501, 150)
    ]
    train = {
        "schema": 1,
        "backend": backend,
        "version": "1.0",
        "seed": int(seed),
        "budget": {"iterations": 1500, "seconds": None},
        "iterations": 1500,
        "seconds": seconds,
        "device": "cpu",
        "threads": 1,
        "peak_rss_bytes": 400_000_000 + 1_000_000 * len(selector),
        "n_primitives": 20000,
        "commit": "0123456789ab",
        "scene_sha256": "a" * 64,
        "seeding": {"source": "scene"},
        "curve": curve,
    }
    _write(at / "train.json", train)
    metrics = {"schema": 1, "psnr_db": float(psnr), "ssim": views[0]["ssim"], "lpips": views[0]["lpips"]}
    _write(at / "metrics.json", metrics | {"seconds": 1.5, "views": views})
    for number in range(len(views)):
        _picture(at / views[number]["file"], number, 0.1 * len(selector))
    return row | {
        "dataset": "generated_room",
        "n_views": n_views,
        "count": count,
        "psnr_db": float(psnr),
        "ssim": metrics["ssim"],
        "lpips": "" if metrics["lpips"] is None else metrics["lpips"],
        "select_s": 0.005 + 0.002 * len(selector),
        "train_s": seconds,
        "evaluate_s": 1.5,
        "iterations": 1500,
        "peak_rss_bytes": train["peak_rss_bytes"],
        "commit": "0123456789ab",
        "scene_sha256": "a" * 64,
        "selection_sha256": "b" * 64,
        "viewbench": "0.1.0",
    }


def _picture(path, number, shift):
    y, x = np.mgrid[0:24, 0:32] / 32
    pixels = np.stack([x + shift / 4, y, np.full_like(x, (number % 7) / 7)], axis=-1)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.round(255 * np.clip(pixels, 0, 1)).astype(np.uint8)).save(path)


def _write(path, value):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value), encoding="utf-8")
