"""A datasheet: lengths and rates of known ways, and files for captures with and without times."""

import csv
import json

import numpy as np
import pytest

from viewbench.reports._datasheet import length
from viewbench.workflow.commands import _main


def test_the_length_of_a_way_leaves_jitter_out():
    times = np.arange(0, 10, 0.01)
    straight = np.stack([0.5 * times, np.zeros_like(times), np.zeros_like(times)], axis=1)
    assert length(times, straight) == pytest.approx(0.5 * 9.9)
    shaken = straight + np.random.default_rng(0).normal(scale=0.001, size=straight.shape)
    assert length(times, shaken) == pytest.approx(0.5 * 9.9, rel=0.01)
    assert np.linalg.norm(np.diff(shaken, axis=0), axis=1).sum() > 5.2
    assert length(times[:1], straight[:1]) == 0


def test_a_row_for_each_capture_with_maps_and_views(tmp_path, capsys):
    bare = tmp_path / "bare"
    (bare / "images").mkdir(parents=True)
    frames = []
    for i in range(3):
        from PIL import Image

        Image.new("RGB", (32, 24), (40 * i, 90, 200)).save(bare / "images" / f"{i}.png")
        pose = np.eye(4)
        pose[:3, 3] = i, 0, 1
        frames.append({"file_path": f"images/{i}.png", "transform_matrix": pose.tolist()})
    (bare / "transforms.json").write_text(json.dumps({"fl_x": 30, "w": 32, "h": 24, "frames": frames}))
    out = tmp_path / "sheet"
    assert _main.run(["datasheet", "room_human", str(bare), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert said == (out / "captures.md").read_text()
    rows = list(csv.DictReader((out / "captures.csv").open()))
    assert [row["capture"] for row in rows] == ["room_human", "bare"]
    assert (rows[0]["training"], rows[0]["test"], rows[0]["walk"]) == ("400", "40", "human")
    assert float(rows[0]["seconds"]) == pytest.approx(52, abs=1)
    assert rows[1]["seconds"] == "", "it has no times"
    assert rows[1]["pixels"] == "32 × 24"
    for name in ("maps.jpg", "views.jpg"):
        assert (out / name).stat().st_size > 10_000
    views = list(csv.DictReader((out / "views.csv").open()))
    assert [view["split"] for view in views if view["capture"] == "room_human"] == ["train"] * 4 + ["test"] * 2


def test_of_what_has_no_poses_or_no_times_no_motion_is_told(tmp_path, capsys):
    from PIL import Image

    photos = tmp_path / "photos"
    photos.mkdir()
    for i in range(3):
        Image.new("RGB", (32, 24), (40 * i, 90, 200)).save(photos / f"{i}.png")
    assert _main.run(["datasheet", str(photos), "--out", str(tmp_path / "sheet")]) == 0
    (row,) = csv.DictReader((tmp_path / "sheet" / "captures.csv").open())
    assert {key for key, value in row.items() if not value} >= {"seconds", "way_m", "speed 50 %", "turn 50 %"}
    assert not (tmp_path / "sheet" / "maps.jpg").exists()
    assert (tmp_path / "sheet" / "views.jpg").is_file()
