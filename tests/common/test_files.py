import json
import threading

import numpy as np
import pytest

from viewbench.common import files
from viewbench.common.errors import UserError


def test_a_file_appears_whole_or_not_at_all(tmp_path):
    target = tmp_path / "deep" / "result.json"

    def stops_half_way():
        with files.whole(target) as temporary:
            temporary.write_text("half")
            assert not target.exists()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        stops_half_way()
    assert list(target.parent.iterdir()) == []
    files.write_json(target, {"a": 1})
    assert json.loads(target.read_text()) == {"a": 1}
    assert [path.name for path in target.parent.iterdir()] == ["result.json"]


def test_a_failed_write_keeps_the_old_file_and_folder(tmp_path):
    target = tmp_path / "result.json"
    files.write_json(target, [1])
    with pytest.raises(ValueError):
        files.write_json(target, [float("nan")])
    assert files.read_json(target) == [1]
    folder = tmp_path / "folder"
    for number in (1, 2):
        with files.whole_folder(folder) as temporary:
            (temporary / f"{number}.txt").write_text("x")
    with pytest.raises(RuntimeError), files.whole_folder(folder):
        raise RuntimeError
    assert [path.name for path in folder.iterdir()] == ["2.txt"]


def test_writers_side_by_side_never_mix(tmp_path):
    target = tmp_path / "result.json"
    values = [[number] * 5000 for number in range(8)]
    threads = [threading.Thread(target=files.write_json, args=(target, value)) for value in values]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert files.read_json(target) in values


def test_plain_makes_json_of_numpy():
    value = {"a": np.arange(3), "b": np.float32(0.5), "c": (np.int64(2), None)}
    assert files.plain(value) == {"a": [0, 1, 2], "b": 0.5, "c": [2, None]}


@pytest.mark.parametrize("content", [b"{", b"\xff\xfe", b"[" * 100_000])
def test_broken_json_is_a_user_error_that_names_the_file(tmp_path, content):
    path = tmp_path / "broken.json"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"broken\.json"):
        files.read_json(path)


def test_missing_json_is_a_user_error(tmp_path):
    with pytest.raises(UserError, match="No such file"):
        files.read_json(tmp_path / "missing.json")
