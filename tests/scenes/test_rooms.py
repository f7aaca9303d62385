"""Generated rooms: the shipped poses to the last bit, sound geometry, paths with space around them."""

import json
from itertools import combinations

import numpy as np
import pytest
from PIL import Image
from scipy.sparse.csgraph import connected_components

from viewbench.common import plugins
from viewbench.common.settings import PACKAGE
from viewbench.scenes.rooms import _exact, _paths
from viewbench.scenes.rooms._builder import Builder
from viewbench.scenes.rooms._capture import digest
from viewbench.scenes.rooms._clearance import CLEARANCE_M, clearance, space
from viewbench.scenes.rooms._types import Part, Room, Walk

SHIPPED = PACKAGE / "scenes" / "generated_room"
NAMES = plugins.names("scenes.rooms")
TOUCHING_M = 0.05  # what is nearer to another thing rests on it or hangs on it
BEDDED_M = 0.025  # how deep a thing may be in one of another material: skirting, cushions


@pytest.fixture(scope="module", params=NAMES)
def room(request) -> Room:
    return plugins.load("scenes.rooms", request.param).build()


@pytest.mark.parametrize(
    ("path", "file"),
    [
        ("human", "human/transforms_train.json"),
        ("smooth", "smooth/transforms_train.json"),
        ("test", "human/transforms_test.json"),
        ("test", "smooth/transforms_test.json"),
    ],
)
def test_paths_are_those_of_the_shipped_frames_to_the_last_bit(path, file):
    frames = json.loads((SHIPPED / file).read_text())["frames"]
    walk = plugins.load("scenes.rooms", "kitchen-living").build().paths[path](len(frames))
    assert np.array_equal(walk.c2w, [frame["transform_matrix"] for frame in frames])
    assert np.array_equal(walk.times, [frame["time"] for frame in frames])


def test_fixed_sums_are_sums():
    random = np.random.default_rng(0)
    for n in (0, 1, 3, 7, 8, 9, 29, 135, 145):
        a, b = random.normal(size=(5, n)), random.normal(size=n)
        assert np.allclose(_exact.dot(a, b), (a * b).sum(-1), rtol=0, atol=1e-13)
    values = random.normal(size=(60, 2))
    assert np.allclose(_exact.exp(values[:, 0]), np.exp(values[:, 0]), rtol=1e-15)
    flat = _exact.smoothed(np.ones((60, 2)), 3.0)
    assert np.allclose(flat, 1, atol=1e-14)
    for sigma in (3.6, 16.8, 18.0):
        assert np.allclose(_exact._gaussian(sigma), _exact._gaussian(sigma)[::-1], rtol=0, atol=0)


def test_two_builds_are_the_same(room):
    names = [name for name in NAMES if digest(plugins.load("scenes.rooms", name).build()) == digest(room)]
    assert len(names) == 1


def test_meshes_are_sound(room):
    assert set(room.meshes) == set(room.materials)
    for name, mesh in room.meshes.items():
        assert mesh.triangles.min() >= 0
        assert mesh.triangles.max() < len(mesh.vertices), name
        assert all(np.isfinite(values).all() for values in (mesh.vertices, mesh.uv, mesh.normals, mesh.colours))
        corners = mesh.vertices[mesh.triangles].astype(float)
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.linalg.norm(across, axis=1).min() > 0
        given = mesh.normals[mesh.triangles].mean(axis=1)
        lit = np.linalg.norm(given, axis=1) > 0.5
        assert (np.einsum("nk,nk->n", across[lit], given[lit]) > 0).all(), f"{name}: triangles turn their backs"
    for material in room.materials.values():
        if isinstance(material.colour, str) and material.colour != "vertex colour":
            pixels = room.textures[material.colour]
            assert pixels.dtype == np.uint8
            assert pixels.std() > 1


def test_nothing_floats(room):
    """Every part is connected, by parts that touch, to a face of the room; what is outside is seen through a window."""
    low, high = (np.array(values) for values in zip(*(part.bounds for part in room.parts), strict=True))
    near = ((low[:, None] - TOUCHING_M <= high) & (high[:, None] + TOUCHING_M >= low)).all(axis=-1)
    _, group = connected_components(near)
    faces = np.concatenate([low - room.inside[0], room.inside[1] - high], axis=1)
    within = ((high > np.array(room.inside[0])) & (low < np.array(room.inside[1]))).all(axis=1)
    held = set(group[np.abs(faces).min(axis=1) < 1e-6])
    floating = [room.parts[i] for i in np.flatnonzero(within) if group[i] not in held]
    assert floating == []


def overlap(a: Part, b: Part) -> float:
    """How deep two boxes are in one another, by their separating axes; negative where they are apart."""
    directions = [a.axes[:, k] for k in range(3)] + [b.axes[:, k] for k in range(2)]
    reach = (np.abs(p.axes.T @ d) @ p.half for d in directions for p in (a, b))
    return float(min(next(reach) + next(reach) - abs((a.centre - b.centre) @ d) for d in directions))


def test_solids_do_not_go_through_each_other(room):
    """Things of one material are joined from boxes (a sofa, a bookcase), those of two are not."""
    solids = [part for part in room.parts if part.solid]
    through = [
        (a, b)
        for a, b in combinations(solids, 2)
        if a.material != b.material
        and (np.abs(a.centre - b.centre) <= np.linalg.norm(a.half) + np.linalg.norm(b.half)).all()
        and overlap(a, b) > BEDDED_M
    ]
    assert through == []


def test_overlap_is_what_the_builder_was_told():
    builder = Builder()
    builder.box("wood_dark", (0, 0, 0), (1, 1, 1))
    builder.box("wood_red", (0.9, 0, 0), (2, 1, 1))
    builder.box("wood_red", (1.2, 0.2, 0), (1.8, 0.8, 1), angle=np.pi / 4)
    first, second, turned = builder.parts
    assert overlap(first, second) == pytest.approx(0.1)
    assert overlap(first, turned) == pytest.approx(1 - (1.5 - 0.3 * np.sqrt(2)))


def test_cameras_keep_their_distance(room):
    for name, path in room.paths.items():
        walk = path(200)
        assert clearance(room, walk.positions).min() >= CLEARANCE_M, name
        assert np.allclose(walk.c2w[:, :3, :3] @ walk.c2w[:, :3, :3].transpose(0, 2, 1), np.eye(3), atol=1e-12)
        assert np.allclose(np.linalg.det(walk.c2w), 1)
        assert np.allclose(-walk.c2w[:, :3, 2], walk.directions)
        assert (np.diff(walk.times) > 0).all()
        assert len(walk) == 200


def test_clearance_is_the_distance_to_the_nearest_vertex_or_less(room):
    """Points on the meshes are at no distance from the boxes around them; those in the air no farther than a mesh."""
    random = np.random.default_rng(1)
    low, high = (np.array(corner) for corner in room.inside)
    places = random.uniform(low, high, (300, 3))
    vertices = np.concatenate([mesh.vertices for mesh in room.meshes.values()]).astype(float)
    nearest = [np.linalg.norm(vertices - place, axis=1).min() for place in places]
    assert (clearance(room, places) <= np.array(nearest) + 1e-6).all()
    sample = vertices[random.permutation(len(vertices))[:500]]
    assert clearance(room, sample).max() <= 1e-6
    assert (clearance(room, low + [[-1, 1, 1]]) < 0).all()


def test_the_free_space_is_free_and_in_one_piece(room):
    free = space(room)
    assert len(free.points) > 1000
    assert clearance(room, free.points).min() >= CLEARANCE_M - 1e-12
    assert free.free_at(free.points).all()
    assert not free.free_at(np.array([[-5.0, 0, 0], [0, 0, 99.0]])).any()


def test_a_hand_jitters_and_a_robot_does_not():
    events = (_paths.Stay(1.0, ((1, 0, 1),)), _paths.Go((2, 0, 1), 0.5, (3, 0, 1)))
    still, shaken = (_paths.steered(events, (0, 0, 1), seed=3, jitter=jitter) for jitter in (0.0, 1.0))
    assert np.ptp(still.positions[:20], axis=0).max() < 1e-3 < np.ptp(shaken.positions[:20], axis=0).max()
    assert np.array_equal(shaken.positions, _paths.steered(events, (0, 0, 1), seed=3).positions)
    assert not np.array_equal(shaken.positions, _paths.steered(events, (0, 0, 1), seed=4).positions)
    square = [((x, y, 1.0), (0.0, 0.0, 1.0)) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    robot = _paths.constant_speed(square, 200)
    steps = np.linalg.norm(np.diff(robot.positions, axis=0), axis=1)
    assert steps.max() < 1.01 * steps.min()
    assert np.linalg.norm(robot.positions[0] - robot.positions[-1]) == pytest.approx(steps[0], rel=0.02)


def test_picking_keeps_the_ends():
    walk = Walk(np.arange(10.0), np.zeros((10, 3)), np.tile([1.0, 0, 0], (10, 1)))
    assert walk.picked(4).times.tolist() == [0, 3, 6, 9]


def test_shipped_frames_are_encoded_as_render_encodes_them(tmp_path):
    """The same tables and no subsampling: an image that is pixel for pixel the same gives the same file."""
    source = SHIPPED / "human" / "train" / "0000.jpg"
    with Image.open(source) as shipped:
        shipped.save(tmp_path / "again.jpg", quality=95, subsampling=0)
        with Image.open(tmp_path / "again.jpg") as again:
            assert again.quantization == shipped.quantization  # type: ignore[attr-defined]
            assert again.layer == shipped.layer  # type: ignore[attr-defined]
