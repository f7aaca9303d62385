"""`viewbench select` as people use it on their own captures, and what it says to their mistakes."""

import json
import shutil

import numpy as np
import pytest

from viewbench.workflow.commands import _main

PLACES = ("--factors", "pos,ang")  # no encoder


def run(capsys, *arguments):
    """(exit status, standard output, standard error)."""
    status = _main.run(["select", *(str(argument) for argument in arguments)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def names(capsys, *arguments):
    """The chosen names, from a run that must succeed."""
    status, out, err = run(capsys, *arguments)
    assert status == 0, err
    return out.splitlines()


def test_a_capture_in_its_own_process(run_viewbench, small_room, tmp_path):
    done = run_viewbench("select", small_room, "--ratio", 0.25, *PLACES, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    selection = json.loads((tmp_path / "out" / "selection.json").read_text())
    assert done.stdout.splitlines() == selection["names"]
    assert selection["count"] == 3  # a quarter of 12
    keys = "schema scene selector parameters seed n_views count indices names gains seconds viewbench"
    assert set(keys.split()) <= set(selection)
    assert "weights" in done.stderr
    table = json.loads((tmp_path / "out" / "transforms_train.json").read_text())
    assert [frame["file_path"] for frame in table["frames"]] == sorted(selection["names"]), "in capture order"


def test_names_of_any_kind_through_the_command_line(run_viewbench, small_room, tmp_path):
    folder = tmp_path / "my 'own' $(capture) żółć"
    shutil.copytree(small_room, folder)
    done = run_viewbench("select", folder, "--count", 2, *PLACES, "--out", tmp_path / 'out "quoted"')
    assert done.returncode == 0, done.stderr
    assert (tmp_path / 'out "quoted"' / "transforms_train.json").is_file()


def test_same_seed_same_bytes_and_another_seed_another_choice(capsys, small_room, tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        names(
            capsys,
            small_room,
            "--count",
            4,
            *PLACES,
            "--seed",
            seed,
            "--selection",
            tmp_path / f"{name}.json",
            "--dry-run",
        )
    a, b, c = (json.loads((tmp_path / f"{name}.json").read_text()) for name in "abc")
    assert a["indices"] == b["indices"]
    assert a["indices"] != c["indices"]


@pytest.mark.parametrize("selector", ["maxmin", "logdet", "coverage", "kcenter", "random"])
def test_a_larger_ratio_adds_views(capsys, small_room, selector):
    factors = {"maxmin": PLACES, "logdet": PLACES}.get(selector, ())
    few = names(capsys, small_room, "--count", 3, "--selector", selector, *factors, "--dry-run")
    many = names(capsys, small_room, "--count", 7, "--selector", selector, *factors, "--dry-run")
    assert many[:3] == few


def test_a_dry_run_writes_nothing(capsys, small_room, tmp_path):
    assert len(names(capsys, small_room, "--count", 3, *PLACES, "--dry-run", "--out", tmp_path / "out")) == 3
    assert list(tmp_path.iterdir()) == []


def test_force_replaces_and_copy_copies(capsys, small_room, tmp_path):
    out = tmp_path / "out"
    names(capsys, small_room, "--count", 3, *PLACES, "--out", out)
    assert any(path.is_symlink() for path in out.rglob("*"))
    assert run(capsys, small_room, "--count", 3, *PLACES, "--out", out)[0] == 2
    names(capsys, small_room, "--count", 2, *PLACES, "--out", out, "--force", "--copy")
    assert len(list((out / "train").iterdir())) == 2
    assert not any(path.is_symlink() for path in out.rglob("*"))


@pytest.mark.parametrize("suffix", ["png", "html"])
def test_a_picture_of_the_choice(capsys, small_room, tmp_path, suffix):
    if suffix == "html":
        pytest.importorskip("plotly")
    picture = tmp_path / f"choice.{suffix}"
    names(capsys, small_room, "--count", 3, *PLACES, "--dry-run", "--plot", picture)
    content = picture.read_bytes()
    assert content.startswith(b"\x89PNG") if suffix == "png" else b"chosen as number 3" in content
    assert b'src="http' not in content


def test_blurred_frames_lose(capsys, small_room, tmp_path):
    from PIL import Image, ImageFilter

    folder = tmp_path / "blurred"
    shutil.copytree(small_room, folder)
    frames = sorted((folder / "train").iterdir())
    for path in frames[::2]:
        Image.open(path).filter(ImageFilter.GaussianBlur(8)).save(path)
    blurred = {f"train/{path.name}" for path in frames[::2]}
    given = ("--count", 4, *PLACES, "--dry-run", "--seed")
    plain = [name for seed in range(5) for name in names(capsys, folder, *given, seed)]
    sharp = [name for seed in range(5) for name in names(capsys, folder, *given, seed, "--sharpness", 0.9)]
    assert blurred & set(plain)
    assert not blurred & {sharp[4 * seed] for seed in range(5)}  # never the first choice
    assert len([name for name in sharp if name in blurred]) < len([name for name in plain if name in blurred])


def write_features(tmp_path, array):
    np.save(tmp_path / "f.npy", array)
    return ["--features", tmp_path / "f.npy"]


MISTAKES = {
    "neither ratio nor count": ([], "either --ratio or --count"),
    "both": (["--ratio", 0.1, "--count", 3], "either --ratio or --count"),
    "ratio 0": (["--ratio", 0], "(0, 1]"),
    "ratio above 1": (["--ratio", 1.01], "(0, 1]"),
    "ratio nan": (["--ratio", "nan"], "(0, 1]"),
    "ratio text": (["--ratio", "half"], "--ratio"),
    "count 0": (["--count", 0], "[1, 12]"),
    "count above N": (["--count", 13], "[1, 12]"),
    "selector": (["--count", 3, "--selector", "maxmim"], "did you mean 'maxmin'"),
    "factor": (["--count", 3, "--factors", "pos,semm"], "did you mean 'sem'"),
    "parameter": (["--count", 3, "--set", "sigm=1"], "did you mean 'sigma'"),
    "no value": (["--count", 3, "--set", "sigma"], "KEY=VALUE"),
    "sigma": (["--count", 3, *PLACES, "--sigma", 0], "sigma"),
    "weights": (["--count", 3, *PLACES, "--alpha", 2], "alpha"),
    "seed": (["--count", 3, "--seed", -1], "--seed"),
    "encoder": (["--count", 3, "--encoder", "clip"], "unknown encoder"),
    "no features": (["--count", 3, "--features", "/nowhere.npy"], "nowhere.npy"),
    "holdout": (["--count", 3, "--holdout", "every:3"], "test views of its own"),
    "format": (["--count", 3, "--format", "colmap"], "no COLMAP model"),
    "plot": (["--count", 3, *PLACES, "--plot", "choice.bmp"], ".png"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_one_line_and_nothing_is_written(capsys, small_room, tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    arguments, words = MISTAKES[case]
    status, out, err = run(capsys, small_room, *arguments, "--out", tmp_path / "out")
    assert status == 2
    assert out == ""
    last = err.splitlines()[-1]
    assert last.startswith("viewbench: ")
    assert words in last
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.ones((11, 4)), "12"),
        (np.full((12, 4), np.nan), "NaN"),
        (np.zeros((12, 4)), "zeros"),
        (np.ones(12), "12"),
        (np.array(["a"] * 12), "features"),
    ],
)
def test_unfit_features_are_named(capsys, small_room, tmp_path, array, words):
    given = write_features(tmp_path, array)
    status, _, err = run(capsys, small_room, "--count", 3, *given, "--out", tmp_path / "out")
    assert status == 2
    assert words in err.splitlines()[-1]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("damage", ["cut", "missing"])
def test_a_damaged_image_among_the_chosen_is_named(capsys, small_room, tmp_path, damage):
    folder = tmp_path / "in"
    shutil.copytree(small_room, folder)
    for path in (folder / "train").iterdir():
        path.write_bytes(path.read_bytes()[:-300]) if damage == "cut" else path.unlink()
    status, _, err = run(capsys, folder, "--count", 3, *PLACES, "--out", tmp_path / "out")
    assert status == 2
    assert ".jpg" in err.splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_one_missing_image_is_named_even_if_it_is_not_chosen(capsys, small_room, tmp_path):
    folder = tmp_path / "in"
    shutil.copytree(small_room, folder)
    chosen = names(capsys, folder, "--count", 1, *PLACES, "--dry-run")[0]
    gone = next(path for path in sorted((folder / "train").iterdir()) if f"train/{path.name}" != chosen)
    gone.unlink()
    status, _, err = run(capsys, folder, "--count", 1, *PLACES, "--out", tmp_path / "out")
    assert status == 2
    assert gone.name in err
    assert not (tmp_path / "out").exists()
