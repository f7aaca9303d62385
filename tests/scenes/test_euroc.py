"""EuRoC MAV: body poses between two rows, cameras on a rig, and the YAML that others refuse."""

import numpy as np
import pytest
import yaml
from PIL import Image
from scipy.spatial.transform import Rotation

from tests.conftest import known
from tests.scenes.test_transforms import opened
from tests.scenes.walks import between, matrices, walk
from viewbench.common.errors import UserError
from viewbench.scenes.formats import _timed
from viewbench.scenes.subset import write_subset
from viewbench.scenes.types import OPENCV

# Of the data set's V1_01: sensor.yaml of both cameras, as it is laid out there.
SENSOR = """# General sensor definitions.
sensor_type: camera
comment: VI-Sensor {name} (MT9M034)

# Sensor extrinsics wrt. the body-frame.
T_BS:
  cols: 4
  rows: 4
  data: [{rows}]

# Camera specific definitions.
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [{focal}, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]

"""
HEAD = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
    "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]"
)


def offset(number):
    """T_BS of a camera: turned by 90 degrees as EuRoC's, the second one 11 cm beside the first."""
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler("zyx", [91, 2 + number, -1], degrees=True).as_matrix()
    made[:3, 3] = [-0.02, -0.065 + 0.11 * number, 0.01]
    return made


def euroc(root, cameras=2, kind="made up", end="\n", times=None):
    """Lays out a sequence of the path, a frame every twentieth of a second; returns the path and the frames' stamps."""
    times_s, positions, turns = known(walk(kind))
    stamps = [round(value * 1e6) * 1000 + 555 for value in times_s]  # 19 digits: floats do not hold them
    folder = root / "mav0"
    truth = folder / "state_groundtruth_estimate0" / "data.csv"
    truth.parent.mkdir(parents=True)
    quaternions = turns.as_quat()[:, [3, 0, 1, 2]]
    rows = [
        f"{stamp}," + ",".join(f"{value:.9f}" for value in (*place, *turn, 0.1, 0.2, 0.3))
        for stamp, place, turn in zip(stamps, positions, quaternions, strict=True)
    ]
    truth.write_text(end.join([HEAD, *rows, ""]), newline="")
    frames = times or range(stamps[3] + 1_234_567, stamps[-4], 50_000_000)
    for number in range(cameras):
        camera = folder / f"cam{number}"
        (camera / "data").mkdir(parents=True)
        for stamp in frames:
            Image.new("L", (752, 480), stamp % 251).save(camera / "data" / f"{stamp}.png")
        lines = ["#timestamp [ns],filename", *(f"{stamp},{stamp}.png" for stamp in frames), ""]
        (camera / "data.csv").write_text(end.join(lines), newline="")
        numbers = ", ".join(map(repr, offset(number).ravel().tolist()))
        text = SENSOR.format(name=f"cam{number}", rows=numbers, focal=458.654 + number)
        (camera / "sensor.yaml").write_text(text.replace("\n", end), newline="")
    return (np.array(stamps), positions, turns), list(frames)


@pytest.mark.parametrize("kind", ["made up", "real"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_poses_are_those_of_the_body_between_two_rows_moved_to_the_camera(tmp_path, kind, end):
    if walk(kind) is None:
        pytest.skip("the real captures are not here: VIEWBENCH_DATA is not set")
    (stamps, positions, turns), frames = euroc(tmp_path, 1, kind, end)
    scene = opened(tmp_path)
    assert scene.format == "euroc"
    assert scene.train.names == tuple(f"cam0/data/{stamp}.png" for stamp in frames)
    wanted = between((stamps - stamps[0]) / 1e9, positions, turns, (np.array(frames) - stamps[0]) / 1e9)
    np.testing.assert_allclose(scene.train.cameras.c2w, wanted @ offset(0) @ OPENCV, atol=1e-7)  # nine decimals
    camera = scene.train.cameras[0]
    assert [float(v[0]) for v in (camera.fx, camera.fy, camera.cx, camera.cy)] == [458.654, 457.296, 367.715, 248.875]
    np.testing.assert_array_equal(known(camera.distortion)[0], [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0])
    np.testing.assert_allclose(np.diff(known(scene.train.times)), 0.05, atol=1e-6)


def test_two_cameras_are_views_of_a_rig_in_order_of_time(tmp_path):
    _, frames = euroc(tmp_path / "in")
    scene = opened(tmp_path / "in")
    assert scene.train.names == tuple(f"cam{i}/data/{stamp}.png" for stamp in frames for i in (0, 1))
    left, right = scene.train.cameras[0::2], scene.train.cameras[1::2]
    apart = np.linalg.inv(left.c2w @ OPENCV) @ (right.c2w @ OPENCV)
    np.testing.assert_allclose(apart, np.tile(np.linalg.inv(offset(0)) @ offset(1), (len(left), 1, 1)), atol=1e-7)
    assert any("rig" in note for note in scene.notes)
    assert (left.fx[0], right.fx[0]) == (458.654, 459.654)
    write_subset(scene, {"indices": [4, 1]}, tmp_path / "out")
    again = opened(tmp_path / "out").train
    np.testing.assert_allclose(again.cameras.c2w, scene.train.cameras.c2w[[1, 4]], atol=1e-12)
    np.testing.assert_array_equal(again.cameras.fx, scene.train.cameras.fx[[1, 4]])
    np.testing.assert_array_equal(known(again.cameras.distortion), known(scene.train.cameras.distortion)[[1, 4]])


def test_frames_before_after_and_between_poses_are_dropped(tmp_path):
    stamps = [round(value * 1e6) * 1000 for value in known(walk("made up"))[0]]
    inside = stamps[50] + 1000
    (rows, _, _), _ = euroc(tmp_path, 1, times=[stamps[0] - 10_000_000, inside, stamps[200], stamps[-1] + 10_000_000])
    file = tmp_path / "mav0" / "state_groundtruth_estimate0" / "data.csv"
    lines = file.read_text().splitlines()
    kept = [line for line in lines if line.startswith("#") or abs(int(line.split(",")[0]) - stamps[200]) > 60_000_000]
    file.write_text("\n".join(kept))
    scene = opened(tmp_path / "mav0")  # either folder
    assert scene.train.names == (f"cam0/data/{inside}.png",)
    assert scene.notes[0].startswith("cam0: 3 of 4 frames dropped")
    assert rows[0] < inside < rows[-1]


def numbers_of(camera):
    return [float(value[0]) for value in (camera.fx, camera.fy, camera.cx, camera.cy)]


FORMS = {
    # As cv::FileStorage writes a matrix.
    "opencv": "%YAML:1.0\n---\nT_BS: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: [ {flat} ]\n{rest}",
    "nested": "T_BS: [{nested}]\n{rest}",
    "yaml": None,
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("flow", [None, False])
def test_sensor_files_of_other_writers(tmp_path, form, flow):
    euroc(tmp_path, 1)
    before = opened(tmp_path).train.cameras
    rows = offset(0).tolist()
    values = {
        "resolution": [752, 480],
        "intrinsics": [458.654, 457.296, 367.215, 248.375],
        "distortion_model": "radial-tangential",
        "distortion_coefficients": [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05],
    }
    if form == "yaml":
        flat = {"cols": 4, "rows": 4, "data": [value for row in rows for value in row]}
        text = yaml.safe_dump({**values, "T_BS": flat}, default_flow_style=flow)
    else:
        rest = yaml.safe_dump(values, default_flow_style=flow)
        flat = ",\n       ".join(repr(value) for row in rows for value in row)
        text = FORMS[form].format(flat=flat, nested=", ".join(map(str, rows)), rest=rest)
    (tmp_path / "mav0" / "cam0" / "sensor.yaml").write_text(text)
    after = opened(tmp_path).train.cameras
    np.testing.assert_array_equal(after.c2w, before.c2w)
    assert numbers_of(after) == numbers_of(before)
    np.testing.assert_array_equal(known(after.distortion), known(before.distortion))


def test_a_fisheye_camera_is_told(tmp_path):
    euroc(tmp_path, 1)
    file = tmp_path / "mav0" / "cam0" / "sensor.yaml"
    file.write_text(file.read_text().replace("radial-tangential", "equidistant"))
    assert opened(tmp_path).train.lens == "OPENCV_FISHEYE"


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("cam0/sensor.yaml", "intrinsics:", "intrinsic:", "'intrinsics'"),
        ("cam0/sensor.yaml", "367.215,", "", "3 intrinsics"),
        ("cam0/sensor.yaml", "367.215", "x", "no list of numbers"),
        ("cam0/sensor.yaml", "[458.654, 457.296, 367.215, 248.375]", "[917.3, 914.6, 734.4, 496.7]", "1470 x 994"),
        ("cam0/data.csv", ".png\n", ".png\nx,y\n", "line 3"),
        ("cam0/data.csv", ",13", ",../13", "no name of a file"),
        ("state_groundtruth_estimate0/data.csv", ",0.2", ",", None),
        ("state_groundtruth_estimate0/data.csv", "13118681", "999999999999913118681", "line 2"),
    ],
)
def test_a_broken_file_is_named(tmp_path, name, old, new, words):
    euroc(tmp_path, 1)
    file = tmp_path / "mav0" / name
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    if words is None:  # what is not read does not matter
        opened(tmp_path)
        return
    with pytest.raises(UserError, match=words):
        opened(tmp_path)


def test_a_sequence_without_ground_truth_says_so(tmp_path):
    euroc(tmp_path, 1)
    (tmp_path / "mav0" / "state_groundtruth_estimate0" / "data.csv").unlink()
    with pytest.raises(UserError, match="state estimate"):
        opened(tmp_path)


@pytest.mark.parametrize("kind", ["made up", "real"])
def test_poses_between_rows_are_scipys(kind):
    found = walk(kind)
    if found is None:
        pytest.skip("the real captures are not here: VIEWBENCH_DATA is not set")
    times, positions, turns = known(found)
    path = _timed.trajectory(times, positions, -turns.as_quat())  # q and -q are one rotation
    np.testing.assert_allclose(path.poses, matrices(positions, turns), atol=1e-12)
    wanted = np.sort(np.random.default_rng(0).uniform(times[0], times[-1], 300))
    kept, poses = _timed.poses_at(path, wanted)
    assert kept.all()
    np.testing.assert_allclose(poses, between(times, positions, turns, wanted), atol=1e-6)
    flipped = turns.as_quat() * np.where(np.arange(len(times)) % 2, 1, -1)[:, None]
    np.testing.assert_allclose(
        _timed.poses_at(_timed.trajectory(times, positions, flipped), wanted)[1], poses, atol=1e-9
    )
    exact, same = _timed.poses_at(path, times)
    assert exact.all()
    np.testing.assert_allclose(same, path.poses, atol=1e-12)


def test_over_a_gap_the_nearest_pose_is_taken():
    places = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    path = _timed.trajectory(np.array([0.0, 0.05, 0.5]), places, np.tile([0, 0, 0, 1.0], (3, 1)))
    kept, poses = _timed.poses_at(path, np.array([-0.019, 0.01, 0.06, 0.2, 0.49, 0.53]))
    assert kept.tolist() == [True, True, True, False, True, False]
    np.testing.assert_allclose(poses[:, 0, 3], [0, 0.2, 1, 2])
