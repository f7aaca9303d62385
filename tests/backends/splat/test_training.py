"""The whole trainer on a small scene of known Gaussians: it learns, repeats itself, and takes up where it was."""

import numpy as np
import pytest
from plyfile import PlyData

from tests.backends.splat.test_kernels import cloud
from tests.conftest import known
from viewbench.backends import splat
from viewbench.backends._psnr import psnr_db
from viewbench.backends._types import Budget, Report, TrainingSet
from viewbench.backends.splat import layout, loop, ply, stages
from viewbench.backends.splat.backward import Moments
from viewbench.backends.splat.options import Rendering
from viewbench.backends.splat.relocate import relocate
from viewbench.backends.splat.snapshot import State
from viewbench.backends.splat.team import Team
from viewbench.common.errors import UserError
from viewbench.scenes.types import Cameras, Points

SIZE = 32


def cameras(n):
    """n cameras on a circle around the middle, looking at it."""
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    back = np.stack([np.cos(angle), np.zeros(n), np.sin(angle)], axis=1)
    up = np.tile([0.0, 1.0, 0.0], (n, 1))
    right = np.cross(up, back)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = np.stack([right, up, back], axis=2)
    poses[:, :3, 3] = 3 * back
    one = np.ones(n)
    size = np.full(n, SIZE, np.int64)
    return Cameras(poses, 40 * one, 40 * one, SIZE / 2 * one, SIZE / 2 * one, size, size)


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    truth = cloud(60, rng, spread=0.2)
    truth[11:14] *= 0.5
    seen = cameras(9)
    images = np.stack(list(loop.draw(truth, seen, Rendering())))
    points = Points(truth[:3].T.astype(np.float64), np.full((60, 3), 128, np.uint8), tuple([np.array([0, 3, 6])] * 60))
    return TrainingSet("toy", tuple(map(str, range(9))), seen, images, points, np.arange(9), seen)


def run(data, folder, iterations: int | None = 200, seed=1, seconds=None, **options):
    folder.mkdir(parents=True, exist_ok=True)
    chosen = {**splat.CAPABILITIES.options, **options}
    return splat.train(data, folder, seed, Budget(iterations, seconds), chosen, Report())


def score(folder, data):
    pictures = list(splat.render(folder, data.cameras))
    return np.mean([psnr_db(picture, image) for picture, image in zip(pictures, data.images, strict=True)])


def test_training_makes_the_pictures_better(data, tmp_path):
    record = run(data, tmp_path / "long", 300)
    run(data, tmp_path / "short", 5)
    assert score(tmp_path / "long", data) > score(tmp_path / "short", data) + 5
    assert known(record.curve[-1]["loss"]) < 0.5 * known(record.curve[0]["loss"])
    steps = [known(point["step"]) for point in record.curve]
    assert steps == sorted(set(steps))
    assert record.iterations == 300
    assert record.seeding.source.startswith("scene")


def test_same_seed_same_bytes(data, tmp_path):
    for name, number in (("a", 1), ("b", 1), ("c", 2)):
        run(data, tmp_path / name, 60, number)
    models = {name: (tmp_path / name / "model.ply").read_bytes() for name in "abc"}
    assert models["a"] == models["b"]
    assert models["a"] != models["c"]


@pytest.mark.parametrize("smallest", [1000, 8], ids=["full size", "half size first"])
def test_a_killed_run_ends_in_the_same_bytes(data, tmp_path, monkeypatch, smallest):
    monkeypatch.setattr(stages, "SMALLEST", smallest)
    run(data, tmp_path / "whole", 120)
    monkeypatch.setattr(loop, "SNAPSHOT_S", 0.0)

    def die(state, folder, real=State.save):
        real(state, folder)
        if state.step >= 60:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(State, "save", die)
        with pytest.raises(KeyboardInterrupt):
            run(data, tmp_path / "killed", 120)
    assert not (tmp_path / "killed" / "model.ply").exists()
    assert known(State.load(tmp_path / "killed")).step == 60
    run(data, tmp_path / "killed", 120)
    assert (tmp_path / "killed" / "model.ply").read_bytes() == (tmp_path / "whole" / "model.ply").read_bytes()
    assert sorted(path.name for path in (tmp_path / "killed").iterdir()) == ["model.ply", "splat.json"]


def test_pictures_of_half_the_size_come_first(data, tmp_path, monkeypatch):
    monkeypatch.setattr(stages, "SMALLEST", 8)
    sizes = []

    def note(trainer, *arguments, real=stages.Trainer.step):
        sizes.append(trainer.renderer.width)
        return real(trainer, *arguments)

    monkeypatch.setattr(stages.Trainer, "step", note)
    run(data, tmp_path, 100, coarse=0.25)
    assert sizes[1:] == [SIZE // 2] * 25 + [SIZE] * 75  # the very first warms up
    assert score(tmp_path, data) > 20


def test_small_pictures_are_not_halved(data):
    assert stages.halved(data, 10, Rendering(), Team()) is None


def test_a_picture_of_half_the_size_is_of_the_same_things(data):
    from viewbench.backends._shrink import cameras_shrunk, images_shrunk

    g = cloud(60, np.random.default_rng(0), spread=0.3)
    whole = np.stack(list(loop.draw(g, data.cameras, Rendering())))
    half = np.stack(list(loop.draw(g, cameras_shrunk(data.cameras, 2), Rendering())))
    shrunk = images_shrunk(whole, 2)
    right, shifted = np.abs(half - shrunk).mean(), np.abs(half - np.roll(shrunk, 1, axis=2)).mean()
    assert right < 0.4 * shifted


def test_a_broken_snapshot_is_as_none(data, tmp_path):
    (tmp_path / "snapshot.npz").write_bytes(b"PK\x03\x04 broken")
    assert State.load(tmp_path) is None
    assert run(data, tmp_path, 20).iterations == 20


def test_a_budget_of_seconds_ends_the_run(data, tmp_path):
    record = run(data, tmp_path, None, seconds=0.2)
    assert 0.2 <= record.seconds < 5
    assert record.iterations > 0
    assert run(data, tmp_path / "both", 20, seconds=1000).iterations == 20


def test_the_model_is_a_standard_file(data, tmp_path):
    run(data, tmp_path, 40)
    vertex = PlyData.read(tmp_path / "model.ply")["vertex"]
    wanted = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *(f"f_rest_{k}" for k in range(9))]
    wanted += ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    assert [prop.name for prop in vertex.properties] == wanted
    assert {prop.val_dtype for prop in vertex.properties} == {"f4"}
    gaussians = ply.read(tmp_path / "model.ply")
    ply.write(tmp_path / "again.ply", gaussians)
    assert (tmp_path / "again.ply").read_bytes() == (tmp_path / "model.ply").read_bytes()
    # green's second coefficient (of z) is f_rest_4: channels first, then coefficients
    np.testing.assert_array_equal(vertex["f_rest_4"], gaussians[layout.SH1 + 3 + 1])


@pytest.mark.parametrize("content", [b"", b"ply\nformat ascii 1.0\nend_header\n", b"no ply"])
def test_a_broken_model_is_one_sentence(tmp_path, content):
    (tmp_path / "model.ply").write_bytes(content)
    with pytest.raises(UserError, match=r"model\.ply"):
        ply.read(tmp_path / "model.ply")


def test_bad_input_is_refused(data, tmp_path):
    from dataclasses import replace

    one = replace(data, cameras=data.cameras[[0]], images=data.images[:1], points=None, chosen=np.array([0]))
    with pytest.raises(UserError, match="at least 2 views"):
        run(one, tmp_path)
    dirty = data.images.copy()
    dirty[0, 0, 0, 0] = np.nan
    with pytest.raises(UserError, match="NaN"):
        run(replace(data, images=dirty), tmp_path)
    points = Points(np.full((3, 3), np.nan), np.zeros((3, 3), np.uint8))
    run(replace(data, points=points), tmp_path / "nan", 20)
    assert np.isfinite(ply.read(tmp_path / "nan" / "model.ply")).all()


@pytest.mark.parametrize("factor", [1e-4, 1e4])
def test_a_scene_in_other_units_trains_as_well(data, tmp_path, factor):
    from dataclasses import replace

    poses = data.cameras.c2w.copy()
    poses[:, :3, 3] *= factor
    points = Points(data.points.xyz * factor, data.points.rgb, data.points.seen_by)
    moved = replace(data.cameras, c2w=poses)
    scaled = replace(data, cameras=moved, training=moved, points=points)
    run(data, tmp_path / "metres", 150, gaussians=500)
    run(scaled, tmp_path / "scaled", 150, gaussians=500)
    assert abs(score(tmp_path / "metres", data) - score(tmp_path / "scaled", scaled)) < 0.3


def test_a_view_that_sees_nothing_is_harmless(data, tmp_path):
    from dataclasses import replace

    poses = data.cameras.c2w.copy()
    poses[0, :3, 3] += 100  # far away, looking further
    moved = replace(data, cameras=replace(data.cameras, c2w=poses))
    run(moved, tmp_path, 50)
    assert np.isfinite(ply.read(tmp_path / "model.ply")).all()


def test_relocation_hardly_changes_the_picture(data):
    rng = np.random.default_rng(5)
    g = cloud(60, rng, spread=0.2)
    g[10, :30] = -9  # faded out
    g[10, 30:] = np.abs(g[10, 30:])
    before = np.stack(list(loop.draw(g, data.cameras, Rendering())))
    moments = Moments(np.ones_like(g), np.ones_like(g))
    assert relocate(g, moments, rng) == 30
    after = np.stack(list(loop.draw(g, data.cameras, Rendering())))
    assert np.abs(after - before).mean() < 0.02
    assert not moments.first[:, :30].any()
    assert (1 / (1 + np.exp(-g[10])) > 0.004).all()


def test_the_settings_that_are_compared_are_settings():
    from tests.bench.bench_quality import SETTINGS, options
    from viewbench.backends.splat.options import Options

    chosen = {name: Options(**options(text)) for name, text in SETTINGS.items()}
    assert chosen["default"] == Options()
    assert len(set(chosen.values())) == len(SETTINGS)
    assert not chosen["plain"].antialias
