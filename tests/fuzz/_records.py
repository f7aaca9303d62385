"""Fuzzed records: what studies, downloads and renders write and read again, settings, studies and lists."""

import contextlib
import functools
import json
import os
import re
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from tests.fuzz import _files
from tests.fuzz._reader import Input, InvalidError, Reader
from tests.fuzz._scenes import SETTINGS, room
from viewbench.common import catalogue, holding
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.common.files import plain, sealed, sha256_file, write_json
from viewbench.common.settings import PACKAGE
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.formats.images import nominal_cameras
from viewbench.scenes.types import Scene, Split
from viewbench.selectors import _selection
from viewbench.workflow import _study

NAMES = tuple(f"train/{number:04d}.jpg" for number in range(12))


@functools.cache
def small_scene() -> tuple[Scene, str]:
    """A scene of three training views and one test view, kept until the process ends; and its hash."""
    import atexit
    import tempfile

    folder = Path(tempfile.mkdtemp(prefix="viewbench-fuzz-scene-"))
    atexit.register(shutil.rmtree, folder, True)
    scene = room(folder / "room")
    return scene, scene_sha256(scene)


def of_selection(root: Path) -> None:
    scene, sha256 = small_scene()
    record = {
        "schema": 1,
        "scene": scene.name,
        "scene_sha256": sha256,
        "holdout": scene.holdout,
        "selector": "coverage",
        "parameters": {"lam": 0.5},
        "seed": 0,
        "n_views": 3,
        "count": 2,
        "indices": [2, 0],
        "names": [scene.train.names[2], scene.train.names[0]],
        "gains": [1.0, 0.5],
        "greedy": True,
        "notes": {"auto": {}, "below_precision_from": 1},
        "seconds": {"select": 0.1},
    }
    write_json(root / "selection.json", record)
    write_json(root / "sealed.json", sealed(record))


def opens_selection(given: Input) -> None:
    scene, sha256 = small_scene()
    name = given.changed[0]
    selection = _selection.load_selection(given.root / name)
    _selection.selection_sha256(selection)
    indices = _selection.check_selection(selection, scene, sha256)
    if indices.ndim != 1 or not len(indices) or len(set(indices.tolist())) < len(indices):
        raise InvalidError("indices that are no choice")
    first = _selection.first_views(selection, 1)
    _selection.check_selection(first, scene, sha256)
    json.dumps(plain(first), allow_nan=False)


def of_settings(root: Path) -> None:
    shutil.copy(PACKAGE / "environment.toml", root / "environment.toml")
    (root / "small.toml").write_text(
        '[data]\nroot = "/data"\nvideo_cache_gb = 3\n[scenes.a]\npath = "a"\nholdout = "every:8"\nmodel = 0\n'
        'poses = "t.txt"\nintrinsics = "1,2,3,4"\nallow_outside = true\n[command.x]\ntrain = ["a", "{data}"]\n'
        'timeout = 3\nbackground = [0, 1.0, 0]\n[compute]\nthreads = 2\ndevice = "cpu"\n'
    )


def opens_settings(given: Input) -> None:
    from viewbench.scenes.load import _folder
    from viewbench.scenes.whereabouts import absence

    settings = settings_file.load(given.root / given.changed[0])
    for name, entry in settings.scenes.items():
        settings.folder_of(entry)
        absence([name], settings)
        with contextlib.suppress(UserError):  # one that is not there
            _folder(name, entry, settings)
        _ = settings.dataset_of(name, "x"), settings.room_of(name), settings.walk_of(name)
    if settings.compute.threads < 1 or settings.features.batch < 1 or settings.data.video_cache_gb < 1:
        raise InvalidError("numbers that mean nothing")


def of_study(root: Path) -> None:
    for name in ("tiny", "quick", "ablation"):
        shutil.copy(_study.STUDIES / f"{name}.yaml", root / f"{name}.yaml")


def opens_study(given: Input) -> None:
    study = _study.load(str(given.root / given.changed[0]), SETTINGS)
    if not study.cells():
        raise InvalidError("a study without cells")
    json.dumps(study.record(), allow_nan=False)


def of_lists(root: Path) -> None:
    (root / "keep.txt").write_text("# mine\n0001.jpg\ntrain/0002.jpg\n\n0003\n")
    (root / "exclude.txt").write_text("000[4-6].jpg\n*7.jpg\n")
    (root / "given.txt").write_text("0001.jpg,train/0002.jpg,*3.jpg\n")


def opens_lists(given: Input) -> None:
    from viewbench.workflow.commands import _lists

    train = Split(NAMES, tuple(map(Path, NAMES)), nominal_cameras(np.full((len(NAMES), 2), 9)))
    scene = SimpleNamespace(train=train, test=SimpleNamespace(names=("test/0000.png",)))
    text = given.root.joinpath("given.txt").read_bytes().decode(errors="replace").split("\n")[0]
    keep, exclude = (str(given.root / name) for name in ("keep.txt", "exclude.txt"))
    kept = _lists.kept(scene, {"keep": (keep, *((text,) if text else ()))})
    if len(set(kept)) < len(kept) or any(not 0 <= i < len(NAMES) for i in kept):
        raise InvalidError("a view twice, or none")
    mask = _lists.allowed(scene, {"exclude": (exclude,)}, kept)
    if mask is not None and mask.shape != (len(NAMES),):
        raise InvalidError("a mask of another shape")


def of_rules(root: Path) -> None:
    rows = ("every:8", "blocks:2", "none", "50,51,31.5,23.5", "50,51,31.5,23.5,0.1,0,0,0,0.2", "0.5", "2s", "10f", "3")
    (root / "rules.txt").write_text("\n".join(rows))


def opens_rules(given: Input) -> None:
    """Texts that are typed: rules of the test split, intrinsics, ratios, gaps and values of options."""
    from viewbench.scenes.formats._intrinsics import given as intrinsics
    from viewbench.scenes.splits import held_out
    from viewbench.scenes.thinning import Thinning
    from viewbench.selectors._chain import gap_of
    from viewbench.workflow.commands import _options

    scene, _ = small_scene()
    refused = 0
    rows = (given.root / "rules.txt").read_bytes().decode(errors="replace").split("\n")[:12]

    def gap(text: str) -> None:
        limit, at, _ = gap_of(text, scene.train)
        if not limit > 0 or len(at) != len(scene.train):
            raise InvalidError("a gap that is no length")

    def held(text: str) -> None:
        found = held_out(text, 20)
        if len(found) > 18 or (len(found) and not 0 <= found.min() <= found.max() < 20):
            raise InvalidError("test views that are none")

    def lens(text: str) -> None:
        camera = intrinsics(text)
        if not (camera.fx > 0 and camera.fy > 0):
            raise InvalidError("focal lengths that are none")

    def number(text: str) -> None:
        with contextlib.suppress(ValueError):
            value = float(text)
            if not 1 <= _selection.count_of(value, 20) <= 20:
                raise InvalidError("a count that is none")
            Thinning(fps=value)

    for text in rows:
        for use in (held, lens, gap, number, lambda text: _options.settings_of((text, f"a={text}"))):
            try:
                use(text)
            except UserError as error:
                if "\n" in str(error):
                    raise InvalidError("a message of two lines") from None
                refused += 1
    if refused >= 5 * len(rows):
        raise UserError("none of the lines is a rule")


def of_catalogue(root: Path) -> None:
    text = (PACKAGE / "scenes" / "catalogue.toml").read_text(encoding="utf-8").split("\n[")
    (root / "catalogue.toml").write_text("\n[".join(text[:12]), encoding="utf-8")


def opens_catalogue(given: Input) -> None:
    os.environ[catalogue.VARIABLE] = str(given.root / "catalogue.toml")
    try:
        catalogue._read.cache_clear()
        for data in catalogue.read().values():
            _ = data.size, data.licence.says, data.citation
            for scene in data.scenes.values():
                _ = scene.size, scene.path, catalogue.find(scene.name), catalogue.at(scene.path)
                if not isinstance(scene.path, str) or ".." in scene.path or scene.path.startswith("/"):
                    raise InvalidError("a scene outside data.root")
            if data.scenes:
                catalogue.command(catalogue.expand(data.name))
    finally:
        del os.environ[catalogue.VARIABLE]
        catalogue._read.cache_clear()


ADDRESS = "https://example.org/a.zip"
LISTED = catalogue.Listed("set", "room", "room", catalogue.Archive(ADDRESS), "room/")
DATA = catalogue.DataSet("set", "A set", "", "", "", catalogue.Licence("CC", "", ""), format="colmap")


def of_downloads(root: Path) -> None:
    folder = root / "set" / "room"
    (folder / "images").mkdir(parents=True)
    (folder / "images" / "a.png").write_bytes(b"12345")
    write_json(folder / "download.json", {"schema": 1, "scene": "set/room", "files": {"images/a.png": 5}})
    write_json(root / ".viewbench" / "hashes.json", {ADDRESS: {"file": "a" * 64}, "other": {"directory": "b" * 64}})
    write_json(root / "state.json", {"force": False, "directory": "c" * 64, "unpacked": ["seq-01.zip"]})


def opens_downloads(given: Input) -> None:
    from viewbench.scenes.download.hashes import Hashes
    from viewbench.scenes.download.receipt import _move_added, is_there
    from viewbench.scenes.download.unfinished import State

    root, refused = given.root, []

    def states() -> None:
        shutil.copy(root / "state.json", given.spare / "state.json")
        state = State(given.spare / "state.json", given.spare / "staging")
        _ = state.directory, state.unpacked
        state.begin(False)
        state.of("d")
        state.has_unpacked("seq-02.zip")
        state.end()

    def hashes() -> None:
        known = Hashes(root, lambda text: None, shipped=root / ".viewbench" / "hashes.json")
        known.check(ADDRESS, "file", "a" * 64, record=False)

    def added() -> None:
        shutil.copytree(root / "set" / "room", given.spare / "old")
        (given.spare / "new").mkdir()
        _move_added(given.spare / "old", given.spare / "new")

    given.spare.mkdir()
    for use in (lambda: is_there(LISTED, DATA, root), hashes, states, added):
        try:
            use()
        except UserError as error:
            refused.append(error)
        except FileNotFoundError as error:
            if Path(str(error.filename)).exists() or "state.json" not in str(error):
                raise
    if refused:
        raise refused[0]


JOB_TIMES = np.arange(2.0)


def of_render(root: Path) -> None:
    from viewbench.scenes.rooms import _capture

    job, empty = _job()
    write_json(root / "render_train.json", job.record(empty))
    write_json(root / "render_test.json", {**job.record(empty), "path": "other"})
    write_json(root / "seen_test.json", {"schema": 1, "seen": {"test/0000.png": 0.5, "test/0001.png": 1}})
    assert _capture.check_folder(root, job, empty) is None


def _job() -> tuple[Any, Any]:
    from viewbench.scenes.rooms import _capture

    empty = SimpleNamespace(meshes={}, materials={}, textures={}, lights=[])
    return _capture.Job("room", "path", JOB_TIMES, np.tile(np.eye(4), (2, 1, 1)), 32, 4), empty


def opens_render(given: Input) -> None:
    from viewbench.scenes.rooms import _capture
    from viewbench.scenes.seen import shares_of

    job, empty = _job()
    _capture.check_folder(given.root, job, empty)
    shares = shares_of(given.root, ["test/0000.png", "test/0001.png"])
    if shares is not None and not all(isinstance(share, (int, float)) and 0 <= share <= 1 for share in shares):
        raise InvalidError("shares outside of [0, 1]")


def of_model(root: Path) -> None:
    """A model of the CPU backend with its record, as `train` leaves it, not sealed."""
    from viewbench.backends import _gaussian_ply
    from viewbench.backends.splat.options import Rendering

    scene, sha256 = small_scene()
    model = root / "model"
    model.mkdir()
    _gaussian_ply.save(model / "model.ply", _files.gaussians(3))
    write_json(model / "splat.json", _rendering(Rendering))
    record = {
        "schema": 1,
        "scene": scene.name,
        "scene_sha256": sha256,
        "holdout": scene.holdout,
        "backend": "splat",
        "version": "1",
        "width": 16,
        "files": {name: sha256_file(model / name) for name in ("model.ply", "splat.json")},
    }
    write_json(model / "train.json", record)


def _rendering(kind: Any) -> dict[str, Any]:
    import typing

    made = {}
    for name, of in typing.get_type_hints(kind).items():
        made[name] = of(getattr(kind, name, 1)) if of in (int, float, bool, str) else [0.0, 0.0, 0.0]
    return made


def opens_model(given: Input) -> None:
    """The model is scored; where the record is as it was, what it says of the files is made to fit."""
    from viewbench.backends import splat
    from viewbench.backends._evaluate import evaluate

    scene, _ = small_scene()
    model = given.root / "model"
    if "model/train.json" in given.changed or not given.changed:
        record = evaluate(model, scene, given.spare, settings=SETTINGS)
        json.dumps(record, allow_nan=False)
        return
    for image in splat.render(model, scene.test.cameras.scaled(16)):
        if image.shape != (16, 16, 3):
            raise InvalidError("a render of another shape")


CELL = {"backend": "splat", "scene": "small", "selector": "uniform", "ratio": "0.5", "seed": "0"}


@functools.cache
def _asked() -> Any:
    """What `collect` compares with: a study of one scene."""
    from dataclasses import replace

    from viewbench.common.settings import SceneEntry
    from viewbench.workflow._stale import Asked

    scene, _ = small_scene()
    settings = replace(SETTINGS, scenes={**SETTINGS.scenes, "small": SceneEntry(str(scene.root.resolve()))})
    file = scene.root.parent / "one.yaml"
    file.write_text(
        "scenes: [small]\nselectors: [uniform]\nratios: [0.5]\nseeds: 1\nbackends: [splat]\nbudget: {iterations: 5}\n"
    )
    return Asked(_study.load(str(file), settings), scene.root.parent / "results", settings)


def of_cell(root: Path) -> None:
    asked = _asked()
    selector, backend = asked.study.selector("uniform"), asked.study.backend("splat")
    scene = asked.scene("small")
    chosen = {"scene": "small", "holdout": "given", "n_views": 3, "indices": [0, 1], "names": scene.names[:2]}
    selection = plain({**asked._selection(CELL, selector), **chosen, "seconds": {"select": 0.1}})
    write_json(root / "selection.json", selection)
    figures = {"seconds": 1.0, "iterations": 5, "peak_rss_bytes": 1, "peak_gpu_bytes": None, "commit": "a"}
    write_json(root / "train.json", {**asked._train(CELL, backend, selection), **figures})
    scores = {"psnr_db": 20.0, "ssim": 0.5, "lpips": None, "seconds": 1.0}
    write_json(root / "metrics.json", {**asked._metrics(CELL, backend, root), **scores})


def opens_cell(given: Input) -> None:
    from viewbench.workflow._collect import _figures
    from viewbench.workflow._heal import _sound, _whole_model

    for name in ("selection", "train", "metrics"):
        _sound(given.root / f"{name}.json")
    _whole_model(given.root, given.rng.random() < 0.5)
    row = _figures(CELL, given.root, _asked())
    for key in ("psnr_db", "ssim", "train_s", "select_s", "evaluate_s"):
        none = key in ("psnr_db", "ssim") and row[key] == ""
        if not none and (not isinstance(row[key], (int, float)) or isinstance(row[key], bool)):
            raise InvalidError(f"{key} of a row is no number")


def of_results(root: Path) -> None:
    from tests.reports.fixtures import make_study
    from viewbench.reports import _run

    folder = make_study(
        root.parent / "study", scenes=("room_human",), selectors=("random", "uniform"), ratios=(0.1,), seeds=(0, 1)
    )
    for path in folder.rglob("*.png"):
        path.unlink()
    for path in folder.glob("scenes/*.json"):
        record = json.loads(path.read_text())
        for split in ("train", "test"):
            record[f"n_{split}"] = 4
            record[split] = {key: values[:4] for key, values in record[split].items()}
        record["points"] = record["points"][:5]
        path.write_text(json.dumps(record))
    shutil.copytree(folder, root / "study")
    shutil.rmtree(root.parent / "study")
    _run.run(root / "study", "table-psnr")
    write_json(root / "study" / "tracked.json", {"skipped": "nobody is there"})


def opens_results(given: Input) -> None:
    """What `report` reads: the study, its table, the scenes, the cells' records, and what was drawn before."""
    from viewbench.common import plugins
    from viewbench.reports import _items, _page
    from viewbench.reports import _study as of_reports

    folder = given.root / "study"
    given.spare.mkdir()
    study = of_reports.load(folder)
    for name in study.scenes:
        study.scene(name)
    for cell in study.cells:
        for name in ("selection", "train", "metrics"):
            if cell.ok:
                cell.read(name)
    _items.read(folder / "reports", "table-psnr")
    _page._tracking_words(folder)
    for name in ("table-psnr", "scenes", "over-rooms"):
        _items.write(given.spare, name, plugins.load("reports", name).build(study, given.spare))


def of_caches(root: Path) -> None:
    from tests.scenes.test_video import encode, scenery
    from viewbench.scenes.formats import _video_cache, video

    encode(root / "walk.mp4", scenery(4))
    with _cache(root / "cache"):
        video.read(root / "walk.mp4", cache_gb=1)
        for file in _video_cache._held.values():
            file.close()
        _video_cache._held.clear()
    for path in (root / "cache").rglob("lock"):
        path.unlink()


@contextlib.contextmanager
def _cache(folder: Path):
    before = os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = str(folder)
    try:
        yield
    finally:
        os.environ.pop("XDG_CACHE_HOME")
        os.environ |= {"XDG_CACHE_HOME": before} if before else {}


def opens_caches(given: Input) -> None:
    """A video whose cache was damaged, as by a machine that lost its power."""
    from viewbench.scenes.formats import _video_cache, video

    cache = given.spare / "cache"
    shutil.copytree(given.root / "cache", cache)
    with _cache(cache):
        try:
            scene = video.read(given.root / "walk.mp4", cache_gb=1)
            if not all(path.is_file() for path in scene.train.paths):
                raise InvalidError("a picture that is not there")
        finally:
            for file in _video_cache._held.values():
                file.close()
            _video_cache._held.clear()


def of_digests(root: Path) -> None:
    of_a = "2816597888e4a0d3a36b82b83316ab32680eb8f00f8cd3b904d681246d285a0e"
    text = json.dumps({"00": [100, 1, 1, 1, of_a], "01": [1, 2, 3, 4, "b" * 64]})
    (root / "known.json").write_text(text)


def opens_digests(given: Input) -> None:
    from unittest import mock

    from viewbench.scenes import digest

    given.spare.mkdir()
    file = given.spare / "a.bin"
    file.write_bytes(b"a" * 100)
    os.utime(file, (1e9, 1e9))
    with _cache(given.spare), mock.patch.multiple(digest, REMEMBERED_BYTES=0, SETTLED_S=-9):
        digest.file_sha256(file)
        state = json.dumps(digest._state(file))[:-1].encode()
        for path in (given.spare / "viewbench" / "digests").iterdir():
            text = (given.root / "known.json").read_bytes().replace(b'"00"', f'"{os.fsencode(file).hex()}"'.encode())
            path.write_bytes(text.replace(b"[100, 1, 1, 1", state))
        if not re.fullmatch("[0-9a-f]{64}", digest.file_sha256(file)):
            raise InvalidError("a hash that is none")


def of_progress(root: Path) -> None:
    from types import SimpleNamespace

    from viewbench.workflow import _progress_file

    at_it = SimpleNamespace(rule="train", wildcards={key: str(value) for key, value in CELL.items()}, began=1.0)
    file = _progress_file.RunFile(root)
    needs = {"scene": "small", "selector": "uniform", "part": "0.5", "seed": "0"}
    file.failed["a.json"] = _progress_file.Job("select", needs, 1.0, "why", "a.log")
    file.write(SimpleNamespace(clock=lambda: 2.0, running={"a": at_it}), 60.0, "1 of 2", at_once=True)
    with open(root / "held.json", "wb") as held:
        holding.write(held.fileno(), holding.me())


def opens_progress(given: Input) -> None:
    """What `status` and a second run make of the files that a run leaves."""
    from viewbench.workflow import _alone, _progress_file, _standing
    from viewbench.workflow.commands import status

    with open(given.root / "held.json", "rb") as held:
        record = holding.read(held.fileno())
    _ = holding.reaches(record), holding.named(record), _alone._lives(record.get("pid"))
    run = _progress_file.read(given.root)
    asked = _asked()
    cells = _standing.standing(asked.study, given.root, SETTINGS, run)
    counts = _standing.counts(cells)
    _standing.beside(asked.study, run)
    status._lines(asked.study, given.root, "one", run, cells, counts, None)
    json.dumps(status._record(asked.study, run, cells, counts, status._left(run)), allow_nan=False)
    if run is None:
        raise UserError("nothing is known of a run")


READERS = (
    Reader("selection", of_selection, opens_selection, whole=True),
    Reader("settings", of_settings, opens_settings, whole=True),
    Reader("study", of_study, opens_study, package="jsonschema", whole=True),
    Reader("lists", of_lists, opens_lists, whole=True),
    Reader("rules", of_rules, opens_rules, whole=True),
    Reader("catalogue", of_catalogue, opens_catalogue),
    Reader("downloads", of_downloads, opens_downloads),
    Reader("render", of_render, opens_render),
    Reader("model", of_model, opens_model, package="numba"),
    Reader("cell", of_cell, opens_cell, package="jsonschema"),
    Reader("progress", of_progress, opens_progress, package="jsonschema", whole=True),
    Reader("results", of_results, opens_results, package="matplotlib"),
    Reader("video-cache", of_caches, opens_caches, package="av"),
    Reader("digests", of_digests, opens_digests, whole=True),
)
