"""Downloads against a server that breaks off, stalls, lies, and gives something else than it was asked for."""

import dataclasses
import io
import json
import random
import shutil
import subprocess
import tarfile
import urllib.request
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.scenes.download_server import Server, becomes
from viewbench.common import catalogue
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes.download import bring as bring_module
from viewbench.scenes.download import http, receipt
from viewbench.scenes.download.bring import Place, bring
from viewbench.scenes.download.ranges import GAP, TAIL
from viewbench.scenes.download.unfinished import alone
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_scene

QUICK = http.Patience(timeout=5, tries=4, pause=0)
ONCE = http.Patience(timeout=5, tries=1, pause=0)
HEAD = """
[set]
title = "A set"
home = "https://example.org/"
citation = "Somebody, Something"
source = "here"
format = "{format}"
holdout = "{holdout}"
licence = {{ name = "ours", address = "https://example.org/licence", says = "do as you like" }}
"""


@pytest.fixture
def server():
    running = Server()
    yield running
    running.close()


@pytest.fixture(autouse=True)
def direct(monkeypatch):
    """No proxy of this machine stands between."""
    for name in ("http_proxy", "https_proxy", "all_proxy"):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)


@pytest.fixture
def listed(tmp_path, monkeypatch):
    """Writes a catalogue with these scenes, given as TOML, and returns one of them."""

    def write(text, scene="room", format="colmap", holdout="every:4"):
        file = tmp_path / "catalogue.toml"
        file.write_text(HEAD.format(format=format, holdout=holdout) + text, encoding="utf-8")
        monkeypatch.setenv(catalogue.VARIABLE, str(file))
        catalogue._read.cache_clear()
        return catalogue.expand(f"set/{scene}")[0]

    yield write
    catalogue._read.cache_clear()


class Fetch:
    """Calls `bring` with one place, and keeps what was said."""

    def __init__(self, root):
        self.root, self.said = root, []

    def __call__(self, scene, force=False, patience=QUICK):
        place = Place(self.root, self.said.append, patience=patience)
        return bring(scene, catalogue.read()["set"], place, force)


@pytest.fixture
def fetch(tmp_path):
    return Fetch(tmp_path / "data")


@pytest.fixture(scope="module")
def capture(small_room, tmp_path_factory):
    """A COLMAP capture, as bytes by name, with what real ones have: a name of many alphabets, empty files, folders."""
    folder = tmp_path_factory.mktemp("capture") / "room"
    scene = open_scene(str(small_room), settings_file.Settings(Path()))
    scene = dataclasses.replace(scene, test=scene.test.subset([]))
    write_scene(scene, np.arange(len(scene.train)), folder, "colmap", links="copy")
    noise = random.Random(0)
    (folder / "images_2" / "деталь").mkdir(parents=True)
    (folder / "images_2" / "деталь" / "küche 1.jpg").write_bytes(noise.randbytes(5000))
    (folder / "empty.txt").write_bytes(b"")
    return contents(folder)


def contents(folder):
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != receipt.RECEIPT)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def packed(scenes, more=(), compression=zipfile.ZIP_STORED, **given):
    """A zip of {scene: {name: bytes}}, members of scenes one after the other."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for scene, files in scenes.items():
            archive.mkdir(scene)
            for number, (name, data) in enumerate(files.items()):
                info = zipfile.ZipInfo(f"{scene}/{name}", (2020, 1, 1, 0, 0, 0))
                info.compress_type = zipfile.ZIP_DEFLATED if number % 3 == 0 else compression
                with archive.open(info, "w", **given) as file:
                    file.write(data)
        for name, data in more:
            archive.writestr(name, data)
    return buffer.getvalue()


def other_scene(seed, count=40, size=100_000):
    noise = random.Random(seed)
    return {f"images/{i:04d}.jpg": noise.randbytes(size) for i in range(count)}


@pytest.fixture
def large(server, listed, capture):
    """An archive in which the capture stands between two scenes of 4 MB each."""
    data = packed({"before": other_scene(1), "room": capture, "after": other_scene(2)}, [("__MACOSX/room/._x", b"x")])
    served = server.serve("/all.zip", data)
    text = f'archives = {{ all = {{ address = "{server.url("/all.zip")}" }} }}\n'
    scene = listed(text + '[set.scenes]\nroom = { archive = "all", prefix = "room/" }\nb = { archive = "all" }')
    return scene, served


def tarred(files, prefix="room/"):
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz", compresslevel=1) as archive:
        for name, data in files.items():
            info = tarfile.TarInfo(prefix + name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    return buffer.getvalue()


@pytest.fixture
def single(server, listed, capture):
    """A tgz of one scene."""
    served = server.serve("/room.tgz", tarred(capture))
    scene = listed(f'[set.scenes.room]\naddress = "{server.url("/room.tgz")}"\nprefix = "room/"')
    return scene, served


# One scene of an archive of many


def test_one_scene_of_a_large_archive_is_four_requests_and_not_the_rest(server, large, fetch, capture):
    scene, served = large
    folder = fetch(scene)
    assert contents(folder) == capture
    assert len(server.asked) <= 4
    needed = sum(len(data) for data in capture.values())
    assert server.sent("/all.zip") < needed + TAIL + 20_000 < len(served.data) / 2
    record = json.loads((folder / receipt.RECEIPT).read_text(encoding="utf-8"))
    assert record["scene"] == "set/room"
    assert record["files"] == {name: len(data) for name, data in capture.items()}
    left = {path.name for path in fetch.root.rglob("*") if path.name.startswith((".part", ".old"))}
    assert left == set()


def test_members_that_lie_apart_are_as_many_requests(server, listed, fetch, capture):
    half = dict(list(capture.items())[::2]), dict(list(capture.items())[1::2])
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for number, part in enumerate(half):
            for name, data in part.items():
                archive.writestr(f"room/{name}", data)
            archive.writestr(f"other/{number}", random.Random(number).randbytes(2 * GAP))
    served = server.serve("/all.zip", buffer.getvalue())
    text = f'archives = {{ all = {{ address = "{server.url("/all.zip")}" }} }}\n'
    scene = listed(text + '[set.scenes]\nroom = { archive = "all", prefix = "room/" }')
    assert contents(fetch(scene)) == capture
    assert len(server.asked) <= 5
    needed = sum(len(data) for data in capture.values())
    assert server.sent("/all.zip") < needed + TAIL + 20_000 < len(served.data) - 3 * GAP


def test_what_is_there_is_left_alone(server, large, fetch):
    folder = fetch(large[0])
    before = len(server.asked)
    assert fetch(large[0]) == folder
    assert len(server.asked) == before
    (folder / "images_2" / "деталь" / "küche 1.jpg").unlink()
    with pytest.raises(UserError, match=r"1 of its \d+ files are missing or changed.*küche 1.jpg.*--force"):
        fetch(large[0])
    fetch(large[0], force=True)
    assert (folder / "images_2" / "деталь" / "küche 1.jpg").is_file()


def test_a_folder_that_somebody_put_there_is_left_alone_if_it_is_a_capture(server, large, fetch, capture):
    folder = fetch.root / "set" / "room"
    for name, data in capture.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    assert fetch(large[0]) == folder
    assert server.asked == []
    for model in folder.rglob("sparse"):
        shutil.rmtree(model)
    with pytest.raises(UserError, match="no colmap capture; remove it, or --force"):
        fetch(large[0])


@pytest.mark.parametrize("step", [1, 997, 70_000])
def test_a_connection_that_breaks_off_again_and_again_is_gone_on_with(server, large, fetch, capture, step):
    scene, served = large
    served.faults = [("break", step if step > 1 else number) for number in (0, 1, 3, 700, 2_000, 50_000)] * 3
    patience = http.Patience(timeout=5, tries=9, pause=0)
    assert contents(fetch(scene, patience=patience)) == capture
    needed = sum(len(data) for data in capture.values())
    assert server.sent("/all.zip") < needed + 2 * TAIL + 40_000


def test_the_next_call_does_not_fetch_what_is_there(server, large, fetch, capture):
    scene, served = large
    needed = sum(len(data) for data in capture.values())
    served.faults = [("", 0), ("", 0), ("break", needed * 2 // 3)]
    with pytest.raises(UserError, match=r"broke|closed.*what came is kept, and the same command goes on"):
        fetch(scene, patience=ONCE)
    assert not (fetch.root / "set" / "room").exists()
    first = server.sent("/all.zip")
    assert contents(fetch(scene)) == capture
    largest = max(len(data) for data in capture.values())
    assert server.sent("/all.zip") - first < needed / 3 + largest + TAIL + 20_000
    assert any("files are there already" in text for text in fetch.said)


def test_what_was_left_half_written_or_damaged_is_fetched_again(server, large, fetch, capture):
    scene, served = large
    served.faults = [("", 0), ("", 0), ("break", 150_000)]
    with pytest.raises(UserError):
        fetch(scene, patience=ONCE)
    there = contents(fetch.root / "set" / ".part-room")
    whole = next(name for name, data in there.items() if data and data == capture[name])
    (fetch.root / "set" / ".part-room" / whole).write_bytes(there[whole][::-1])  # the same length
    assert contents(fetch(scene)) == capture


def test_another_archive_in_the_middle_is_begun_anew(server, large, fetch, capture):
    scene, served = large
    changed = {name: data[::-1] if name.endswith(".jpg") else data for name, data in capture.items()}
    new = packed({"before": other_scene(1), "room": changed})
    served.faults = [("", 0), ("", 0), ("break", 100_000), becomes(new, '"2"')]
    assert contents(fetch(scene)) == changed
    assert any("has changed while it was read" in text for text in fetch.said)


def test_another_archive_between_two_calls_leaves_nothing_of_the_first(server, large, fetch, capture):
    scene, served = large
    served.faults = [("", 0), ("", 0), ("break", 300_000)]
    with pytest.raises(UserError):
        fetch(scene, patience=ONCE)
    fewer = {name: data for name, data in capture.items() if not name.endswith("0000.jpg")}
    assert fewer != capture
    served.data, served.etag = packed({"room": fewer}), '"2"'
    assert contents(fetch(scene)) == fewer


def test_an_archive_that_never_stays_the_same_ends_in_a_sentence(server, large, fetch, capture):
    scene, served = large
    others = [packed({"room": {**capture, "new.jpg": bytes([i])}}) for i in range(2)]
    turns = [[("", 0), ("", 0), ("break", 10), becomes(others[i % 2], f'"{i}"')] for i in range(9)]
    served.faults = [fault for turn in turns for fault in turn]
    with pytest.raises(UserError, match="becomes another file again and again"):
        fetch(scene)


def test_machines_that_share_the_work_may_each_have_an_etag_of_their_own(server, large, fetch, capture):
    scene, served = large
    turns = [[("", 0), ("", 0), ("break", 90_000), becomes(served.data, f'"{i}"')] for i in range(9)]
    served.faults = [fault for turn in turns for fault in turn]
    assert contents(fetch(scene)) == capture


@pytest.mark.parametrize("lie", [("whole", 0), ("other_range", 7), ("other_range", 1)])
def test_without_parts_the_whole_archive_is_fetched_and_kept_for_the_others(server, large, fetch, capture, lie):
    scene, served = large
    served.always, served.faults = lie, []
    if lie[0] == "other_range":
        served.faults, served.always = [lie], None  # a server that lies once is not asked for parts again
    assert contents(fetch(scene)) == capture
    said = "\n".join(fetch.said)
    assert "gives no parts" in said
    (kept,) = (fetch.root / ".viewbench" / "archives").iterdir()
    assert str(kept) in said
    assert kept.read_bytes() == served.data


def test_parts_that_stop_in_the_middle_are_no_reason_to_begin_anew(server, large, fetch, capture):
    scene, served = large
    served.faults = [("", 0), ("", 0), ("break", 200_000), ("whole", 0)]
    assert contents(fetch(scene)) == capture


@pytest.mark.parametrize("times", [1, 2])
def test_a_member_that_arrives_damaged_is_asked_for_again_once(server, large, fetch, capture, times):
    scene, served = large
    served.faults = [("", 0), ("", 0), *[("flip", 60_000)] * times]
    if times == 1:
        assert contents(fetch(scene)) == capture
    else:
        # The second answer begins at the damaged member: it is the member itself that is damaged there.
        served.faults[-1] = ("flip", 2_000)
        with pytest.raises(UserError, match=r"is damaged at 'room/.*CRC"):
            fetch(scene)


def test_zip64_and_compressed_members_are_read(server, listed, fetch, capture):
    server.serve("/room.zip", packed({"room": capture}, compression=zipfile.ZIP_DEFLATED, force_zip64=True))
    scene = listed(f'[set.scenes.room]\naddress = "{server.url("/room.zip")}"\nprefix = "room/"')
    assert contents(fetch(scene)) == capture


def test_a_scene_deeper_in_the_archive_than_said_is_found(server, listed, fetch, capture):
    server.serve("/room.zip", packed({"data v2/room": capture}, [("camera.json", b"{}"), ("mesh.ply", b"x")]))
    text = f'[set.scenes.room]\naddress = "{server.url("/room.zip")}"\nprefix = "room/"\nalso = ["camera.json"]'
    assert contents(fetch(listed(text))) == {**capture, "camera.json": b"{}"}


def test_a_scene_that_the_archive_has_not_is_named_with_what_it_has(server, listed, fetch, capture):
    server.serve("/room.zip", packed({"kitchen": capture, "attic": capture}))
    scene = listed(f'[set.scenes.room]\naddress = "{server.url("/room.zip")}"\nprefix = "room/"')
    with pytest.raises(UserError, match="has no folder 'room/'; it has attic, kitchen"):
        fetch(scene)


def test_what_is_no_capture_of_the_format_is_not_published(server, listed, fetch):
    server.serve("/room.zip", packed({"room": {"readme.txt": b"moved"}}))
    scene = listed(f'[set.scenes.room]\naddress = "{server.url("/room.zip")}"\nprefix = "room/"')
    with pytest.raises(UserError, match="no colmap capture"):
        fetch(scene)
    assert not (fetch.root / "set" / "room").exists()


def test_a_directory_that_is_larger_than_the_tail_is_one_more_request(server, listed, fetch, capture):
    many = {f"images/{i:05d}.jpg": b"" for i in range(4000)}
    server.serve("/all.zip", packed({"room": capture, "other scene": many}))
    text = f'archives = {{ all = {{ address = "{server.url("/all.zip")}" }} }}\n'
    scene = listed(text + '[set.scenes]\nroom = { archive = "all", prefix = "room/" }')
    assert contents(fetch(scene)) == capture
    assert max(asked.sent for asked in server.asked) > TAIL, "the directory in one request"
    # By range, since on a busy machine one may be asked for again.
    assert len({asked.range for asked in server.asked}) == 4


def test_an_archive_that_was_kept_is_used_and_by_force_fetched_again(server, large, fetch, capture):
    scene, served = large
    served.ranges = False
    fetch(scene)
    shutil.rmtree(fetch.root / "set")
    assert contents(fetch(scene)) == capture
    assert [asked.range for asked in server.asked[-1:]] == ["bytes=0-7"], "asked whether parts are given, no more"
    changed = {**capture, "images/new.jpg": b"new"}
    (fetch.root / ".viewbench" / "hashes.json").unlink()
    served.data, served.etag = packed({"room": changed}), '"2"'
    assert contents(fetch(scene, force=True)) == changed


def test_a_call_by_force_that_broke_off_is_gone_on_with_too(server, large, fetch, capture):
    scene, served = large
    fetch(scene)
    needed = sum(len(data) for data in capture.values())
    served.faults = [("", 0), ("", 0), ("break", needed * 2 // 3)]
    with pytest.raises(UserError):
        fetch(scene, force=True, patience=ONCE)
    assert contents(fetch.root / "set" / "room") == capture, "what is there stays until the new one is whole"
    before = server.sent("/all.zip")
    assert contents(fetch(scene, force=True)) == capture
    assert server.sent("/all.zip") - before < needed


# Archives within archives


@pytest.fixture
def seven(server, listed):
    """A scene as 7-Scenes has it: sequences that are archives themselves."""
    eye = "\n".join(" ".join(f"{float(i == j)}" for j in range(4)) for i in range(4))
    inner = {}
    for number in (1, 2):
        files = other_scene(number, 2, 400_000)
        frames = {f"frame-{i:06d}.color.png": data for i, data in enumerate(files.values())}
        frames |= {f"frame-{i:06d}.pose.txt": eye.encode() for i in range(2)}
        inner[f"seq-{number:02d}"] = frames
    outer = {f"{name}.zip": packed({name: frames}) for name, frames in inner.items()}
    outer |= {"TrainSplit.txt": b"sequence1\n", "TestSplit.txt": b"sequence2\n"}
    served = server.serve("/chess.zip", packed({"chess": outer}))
    text = f'[set.scenes.room]\naddress = "{server.url("/chess.zip")}"\nprefix = "chess/"\nnested = true'
    wanted = {f"{name}/{file}": data for name, frames in inner.items() for file, data in frames.items()}
    return listed(text, format="seven-scenes", holdout=""), served, wanted


def test_archives_in_the_archive_are_unpacked(server, seven, fetch):
    scene, _, wanted = seven
    found = contents(fetch(scene))
    assert {name: data for name, data in found.items() if name.startswith("seq")} == wanted
    assert not [name for name in found if name.endswith(".zip")]


def test_an_archive_in_the_archive_is_not_fetched_twice(server, seven, fetch):
    scene, served, wanted = seven
    served.faults = [("", 0), ("", 0), ("break", 900_000)]
    with zipfile.ZipFile(io.BytesIO(served.data)) as archive:
        second = archive.getinfo("chess/seq-02.zip")
    with pytest.raises(UserError):
        fetch(scene, patience=ONCE)
    there = {path.name for path in (fetch.root / "set" / ".part-room").iterdir()}
    assert "seq-01" in there
    before = server.sent("/chess.zip")
    assert {name for name in contents(fetch(scene)) if name.startswith("seq")} == set(wanted)
    assert server.sent("/chess.zip") - before < second.file_size + TAIL + 20_000 < len(served.data)


# Whole files


def test_a_tgz_is_fetched_checked_and_unpacked(server, single, fetch, capture):
    assert contents(fetch(single[0])) == capture
    assert len(server.asked) == 1
    assert list((fetch.root / ".viewbench" / "archives").iterdir()) == []


def test_a_tgz_goes_on_in_this_call_and_in_the_next(server, single, fetch, capture):
    scene, served = single
    served.faults = [("break", 100_000), ("break", 30_000), ("break", 1)]
    with pytest.raises(UserError, match="the same command goes on"):
        fetch(scene, patience=ONCE)
    assert server.sent("/room.tgz") == 100_000
    assert contents(fetch(scene)) == capture
    later = server.of("/room.tgz")[1:]
    assert [asked.if_range for asked in later] == [served.etag] * len(later)
    assert all(asked.range.startswith("bytes=") for asked in later)
    assert server.sent("/room.tgz") == len(served.data)


@pytest.mark.parametrize(
    ("etag", "modified", "validator"),
    [
        ('W/"weak"', "Mon, 01 Jan 2024 00:00:00 GMT", "Mon, 01 Jan 2024 00:00:00 GMT"),
        ("", "Mon, 01 Jan 2024 00:00:00 GMT", "Mon, 01 Jan 2024 00:00:00 GMT"),
        ("", "", ""),
    ],
)
def test_the_validator_is_the_strongest_that_the_server_gives(
    server, single, fetch, capture, etag, modified, validator
):
    scene, served = single
    served.etag, served.modified, served.faults = etag, modified, [("break", 50_000)]
    assert contents(fetch(scene)) == capture
    assert server.of("/room.tgz")[1].if_range == validator


def test_a_tgz_that_changed_is_fetched_anew(server, single, fetch, capture):
    scene, served = single
    changed = {**capture, "images/new.jpg": b"new"}
    served.faults = [("break", 50_000), becomes(tarred(changed), '"2"')]
    assert contents(fetch(scene)) == changed
    assert any("begun anew" in text for text in fetch.said)


@pytest.mark.parametrize("fault", [("whole", 0), ("other_range", 11)])
def test_a_server_that_does_not_go_on_in_the_middle_is_asked_from_the_start(server, single, fetch, capture, fault):
    scene, served = single
    served.faults = [("break", 50_000), fault]
    assert contents(fetch(scene)) == capture


def test_a_file_that_is_complete_and_was_not_renamed_is_taken(server, single, fetch, capture):
    scene, served = single
    served.faults = [("length", 500)]
    assert contents(fetch(scene)) == capture, "it announced more than there is, and says so itself when asked for more"
    assert server.sent("/room.tgz") == len(served.data)


def test_a_server_that_always_announces_too_much_ends_in_a_sentence(server, single, fetch):
    scene, served = single
    served.ranges, served.always = False, ("length", 500)
    with pytest.raises(UserError, match=rf"announces more than the {len(served.data)} bytes that it sends"):
        fetch(scene)


def test_a_file_that_is_shorter_than_it_should_be_is_found(server, single, fetch, capture):
    scene, served = single
    served.faults = [("length", -3000)]
    with pytest.raises(UserError, match="is damaged"):
        fetch(scene)
    assert contents(fetch(scene)) == capture, "what was damaged does not stay"


@pytest.mark.parametrize("faults", [[("status", 503)] * 3, [("break", 0)] * 3, [("status", 429), ("status", 500)]])
def test_what_passes_is_waited_for(server, single, fetch, capture, faults):
    scene, served = single
    served.faults = faults
    assert contents(fetch(scene)) == capture


def test_a_server_that_stalls_is_left_and_asked_again(server, single, fetch, capture):
    scene, served = single
    served.faults = [("stall", 40_000), ("stall", 0)]
    assert contents(fetch(scene, patience=http.Patience(0.6, 8, 0))) == capture
    assert server.of("/room.tgz")[-1].range != ""


@pytest.mark.parametrize("path", ["/room.tgz", "/room.zip"])
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (("page", 0), r'web page \("Log in to the network"\) instead of the archive'),
        (("status", 404), "answers 404"),
        (("status", 403), "answers 403"),
        (("status", 503), "answers 503 Service Unavailable, 4 times in a row"),
        (("break", 0), "4 times in a row"),
    ],
)
def test_what_is_no_archive_is_named(server, listed, fetch, path, fault, words):
    served = server.serve(path, b"PK\x03\x04" if path.endswith("zip") else b"\x1f\x8b")
    served.always = fault
    scene = listed(f'[set.scenes.room]\naddress = "{server.url(path)}"\nprefix = "room/"')
    with pytest.raises(UserError, match=words) as caught:
        fetch(scene)
    assert path in str(caught.value)
    assert not list(fetch.root.rglob("room"))


@pytest.mark.parametrize(("path", "kind"), [("/room.tgz", "tgz"), ("/room.zip", "zip")])
def test_another_kind_of_file_is_named(server, listed, fetch, path, kind):
    server.serve(path, b"\x89PNG\r\n\x1a\n" + bytes(5000))
    scene = listed(f'[set.scenes.room]\naddress = "{server.url(path)}"\nprefix = "room/"')
    with pytest.raises(UserError, match=rf"is no {kind} archive: it starts with b'\\x89PNG"):
        fetch(scene)


def test_a_page_in_the_middle_does_not_destroy_what_is_there(server, single, fetch, capture):
    scene, served = single
    served.faults = [("break", 60_000), ("page", 0)]
    with pytest.raises(UserError, match="web page"):
        fetch(scene)
    assert contents(fetch(scene)) == capture
    assert server.sent("/room.tgz") < len(served.data) + 5_000


def test_a_port_at_which_nobody_answers_is_named(listed, fetch):
    gone = Server()
    address = gone.url("/room.tgz")
    gone.close()
    scene = listed(f'[set.scenes.room]\naddress = "{address}"\nprefix = "room/"')
    with pytest.raises(UserError, match=r"cannot be reached.*proxy"):
        fetch(scene)


def test_redirects_are_followed_but_not_out_of_encryption(server, single, large, fetch, capture):
    for path in ("/room.tgz", "/all.zip"):
        served = server.files[path]
        server.files["/real" + path] = served
        server.files[path] = type(served)(b"", always=("redirect", "/real" + path))
    assert contents(fetch(large[0])) == capture
    handler = http._Redirects()
    request = urllib.request.Request("https://example.org/a.zip")
    with pytest.raises(UserError, match="not encrypted"):
        handler.redirect_request(request, None, 302, "Found", {}, "http://example.org/a.zip")
    assert handler.redirect_request(request, None, 302, "Found", {}, "https://example.org/b.zip") is not None


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    """A certificate of 127.0.0.1 that nobody has signed, with its key, in one file."""
    folder = tmp_path_factory.mktemp("certificate")
    command = "openssl req -x509 -newkey rsa:2048 -nodes -keyout key.pem -out cert.pem -days 2 -subj /CN=localhost"
    try:
        done = subprocess.run(
            [*command.split(), "-addext", "subjectAltName=IP:127.0.0.1"], cwd=folder, capture_output=True
        )
    except FileNotFoundError:
        pytest.skip("there is no openssl to make a certificate")
    assert done.returncode == 0, done.stderr
    (folder / "both.pem").write_bytes((folder / "key.pem").read_bytes() + (folder / "cert.pem").read_bytes())
    return folder


def test_encrypted_servers_are_reached_by_a_redirect_and_their_certificates_checked(
    server, single, listed, fetch, capture, certificate, monkeypatch
):
    secure = Server(certificate / "both.pem")
    try:
        secure.files["/room.tgz"] = server.files["/room.tgz"]
        address = secure.url("/room.tgz")
        server.serve("/room.tgz", b"", always=("redirect", address))
        with pytest.raises(UserError, match="certificate is not trusted"):
            fetch(single[0])
        monkeypatch.setenv("SSL_CERT_FILE", str(certificate / "cert.pem"))
        assert contents(fetch(single[0])) == capture
        secure.serve("/back.tgz", b"", always=("redirect", server.url("/room.tgz")))
        scene = listed(f'[set.scenes.room]\naddress = "{secure.url("/back.tgz")}"\nprefix = "room/"')
        with pytest.raises(UserError, match="not encrypted; not followed"):
            fetch(scene, force=True)
    finally:
        secure.close()


def test_a_proxy_is_used_where_there_is_one(server, listed, fetch, capture, monkeypatch):
    monkeypatch.setenv("http_proxy", server.url(""))
    server.serve("/room.zip", packed({"room": capture}))
    scene = listed('[set.scenes.room]\naddress = "http://captures.invalid/room.zip"\nprefix = "room/"')
    assert contents(fetch(scene)) == capture
    assert {asked.path for asked in server.asked} == {"http://captures.invalid/room.zip"}


# Hashes


@pytest.mark.parametrize("which", ["single", "large"])
def test_the_first_download_is_recorded_and_the_next_is_checked(request, server, fetch, which):
    scene, served = request.getfixturevalue(which)
    fetch(scene)
    said = next(text for text in fetch.said if "no hash is known for" in text)
    file = fetch.root / ".viewbench" / "hashes.json"
    ((address, known),) = json.loads(file.read_text(encoding="utf-8")).items()
    (old,) = known.values()
    assert address == scene.archive.address
    assert old in said
    assert "later downloads are checked" in said
    fetch(scene, force=True)
    data = {"room": other_scene(9, 3)}
    served.data, served.etag = (tarred(data["room"]) if which == "single" else packed(data)), '"2"'
    with pytest.raises(UserError, match="was changed on the server or on the way") as caught:
        fetch(scene, force=True)
    assert old in str(caught.value)
    assert str(file) in str(caught.value)
    assert (fetch.root / "set" / "room" / "sparse").is_dir(), "what was there stays until the new one is right"


def test_the_hashes_that_ship_come_first(server, single, fetch, tmp_path, monkeypatch):
    scene, _ = single
    shipped = tmp_path / "shipped.json"
    shipped.write_text(json.dumps({scene.archive.address: {"file": "0" * 64}}), encoding="utf-8")
    monkeypatch.setattr(bring_module, "Hashes", lambda root, say: hashes(root, say, shipped))
    hashes = __import__("viewbench.scenes.download.hashes", fromlist=["Hashes"]).Hashes
    with pytest.raises(UserError, match=f"expected {'0' * 64}"):
        fetch(scene)


# What must not happen


@pytest.mark.parametrize("name", ["../evil", "/evil", "room/../../evil", "room\\..\\..\\evil", "C:/evil"])
def test_no_member_of_a_zip_leaves_the_folder(server, listed, fetch, capture, tmp_path, name):
    server.serve("/room.zip", packed({"room": capture}, [(name, b"evil")]))
    scene = listed(f'[set.scenes.room]\naddress = "{server.url("/room.zip")}"\nprefix = "room/"')
    with pytest.raises(UserError, match="leaves the folder"):
        fetch(scene)
    assert not list(tmp_path.rglob("evil*"))
    assert not Path("/evil").exists()


def test_a_link_in_a_zip_is_refused(server, listed, fetch, capture):
    link = zipfile.ZipInfo("room/images/link.jpg")
    link.external_attr = 0o120777 << 16
    server.serve("/room.zip", packed({"room": capture}, [(link, b"/etc/passwd")]))
    scene = listed(f'[set.scenes.room]\naddress = "{server.url("/room.zip")}"\nprefix = "room/"')
    with pytest.raises(UserError, match="has a link"):
        fetch(scene)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("../evil", tarfile.REGTYPE),
        ("/evil", tarfile.REGTYPE),
        ("room/link", tarfile.SYMTYPE),
        ("room/link", tarfile.LNKTYPE),
        ("room/pipe", tarfile.FIFOTYPE),
        ("room/device", tarfile.CHRTYPE),
    ],
)
def test_no_member_of_a_tar_leaves_the_folder(server, listed, fetch, capture, tmp_path, name, kind):
    buffer = io.BytesIO(tarred(capture))
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as archive:
        info = tarfile.TarInfo(name)
        info.type, info.linkname = kind, "/etc/passwd"
        archive.addfile(info)
    server.serve("/room.tgz", buffer.getvalue())
    scene = listed(f'[set.scenes.room]\naddress = "{server.url("/room.tgz")}"\nprefix = "room/"')
    with pytest.raises(UserError, match=r"leaves the folder|link or a device"):
        fetch(scene)
    assert not list(tmp_path.rglob("evil*"))
    assert not (fetch.root / "set" / "room").exists()


@pytest.mark.parametrize("which", ["single", "large"])
def test_a_full_disk_is_found_out_before(request, server, fetch, monkeypatch, which):
    scene, _ = request.getfixturevalue(which)
    usage = shutil.disk_usage(fetch.root.parent)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=(1 << 24) + 100_000))
    with pytest.raises(UserError, match=r"free and .* are needed; make room"):
        fetch(scene)
    assert sum(path.stat().st_size for path in fetch.root.rglob("*.part*") if path.is_file()) == 0


def test_two_calls_at_once_do_not_meet(server, large, fetch):
    with alone(fetch.root, "set/room"), pytest.raises(UserError, match="by another call"):
        fetch(large[0])


def test_a_folder_that_cannot_be_written_is_an_error_of_the_system(server, large, fetch):
    fetch.root.parent.mkdir(exist_ok=True)
    fetch.root.write_text("a file", encoding="utf-8")
    with pytest.raises(NotADirectoryError):
        fetch(large[0])
    assert server.asked == []


def test_a_scene_of_the_catalogue_opens_by_its_name(large, fetch, monkeypatch, tmp_path):
    settings = settings_file.Settings(Path(), data=settings_file.Data(str(fetch.root)))
    with pytest.raises(UserError, match="`viewbench download set/room` brings it"):
        open_scene("set/room", settings)
    fetch(large[0])
    scene = open_scene("set/room", settings)
    assert (scene.name, scene.format) == ("set/room", "colmap")
    assert settings.dataset_of("set/room", "other") == "set"
    assert open_scene("set.room", settings).train.names == scene.train.names
    assert scene.holdout == "every:4"
    assert open_scene(str(fetch.root / "set" / "room"), settings).holdout == "none", "a path is a path"
    monkeypatch.chdir(fetch.root)
    assert open_scene("set/room", settings).holdout == "every:4", "also where the scene's own folder is called so"
    shutil.copytree(fetch.root, tmp_path / "mine")
    monkeypatch.chdir(tmp_path / "mine")
    assert open_scene("set/room", settings).holdout == "none", "another folder of this name comes first"
