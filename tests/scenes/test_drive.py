"""Scenes out of a shared Google Drive folder: by a stand-in of gdown and, where it is installed, by gdown itself.

gdown then asks a server of ours in place of Google's: its own code reads the pages of a folder and of refused files.
"""

import importlib.machinery
import inspect
import io
import sys
import types
import zipfile
from pathlib import Path

import pytest

from tests.scenes.download_server import PAGE, Server
from viewbench.common import catalogue
from viewbench.common.errors import UserError
from viewbench.scenes.download.bring import Place, bring
from viewbench.scenes.download.http import Patience

FOLDER = "1-folder-folder-folder-folder-1"
TEXT = f"""
[set]
title = "A set"
home = "https://example.org/"
citation = "Somebody"
source = "here"
format = "transforms"
drive = "{FOLDER}"
by_hand = "open the folder in a browser and put the scene"
licence = {{ name = "ours", address = "https://example.org/licence", says = "do as you like" }}
[set.scenes]
kitchen_1 = {{ prefix = "kitchen_1/" }}
kitchen_2 = {{ prefix = "kitchen_2/" }}
"""
QUOTA = (
    b'<html><head><title>Google Drive - Quota exceeded</title></head><body><p class="uc-error-subcaption">'
    b"Too many users have viewed or downloaded this file recently.</p></body></html>"
)
SCENE = {"transforms_train.json": b'{"frames": []}', "train/a b.jpg": b"\xff\xd8one", "train/c.jpg": b"\xff\xd8two"}


class StandIn(types.ModuleType):
    """gdown's two functions, with the parameters of its version 6.5.1 (wkentaro/gdown, gdown/download*.py)."""

    class DownloadError(Exception):
        pass

    def __init__(self, files):
        super().__init__("gdown")
        self.files, self.calls = files, []

    def download_folder(
        self,
        url=None,
        id=None,
        output=None,
        quiet=False,
        proxy=None,
        speed=None,
        use_cookies=True,
        verify=True,
        user_agent=None,
        skip_download=False,
        resume=False,
        cookies_file=None,
        timeout=None,
        retries=0,
    ):
        assert (id, skip_download, quiet) == (FOLDER, True, True)
        if self.files is None:
            raise self.DownloadError("Failed to retrieve folder contents (status code 404)")
        return [types.SimpleNamespace(id=name, path=name, local_path=name) for name in self.files]

    def download(
        self,
        url=None,
        output=None,
        quiet=False,
        proxy=None,
        speed=None,
        use_cookies=True,
        verify=True,
        id=None,
        resume=False,
        format=None,
        user_agent=None,
        log_messages=None,
        progress=None,
        skip_download=False,
        cookies_file=None,
        hasher=None,
        timeout=None,
        retries=0,
        cancel=None,
    ):
        self.calls.append(id)
        data = self.files[id]
        if data is QUOTA:
            raise self.DownloadError("Too many users have viewed or downloaded this file recently.")
        Path(str(output)).write_bytes(data)
        return output


@pytest.fixture
def server():
    running = Server()
    yield running
    running.close()


@pytest.fixture(params=["stand-in", "gdown"])
def drive(request, server, tmp_path, monkeypatch):
    """Serves a folder's files by their paths; what it returns calls `bring` for a scene."""
    (tmp_path / "catalogue.toml").write_text(TEXT, encoding="utf-8")
    monkeypatch.setenv(catalogue.VARIABLE, str(tmp_path / "catalogue.toml"))
    monkeypatch.setenv("HOME", str(tmp_path))
    said: list[str] = []

    def fetch(files, scene="kitchen_1", force=False):
        if request.param == "stand-in":
            fake = StandIn(files)
            fake.__spec__ = importlib.machinery.ModuleSpec("gdown", None)
            monkeypatch.setitem(sys.modules, "gdown", fake)
        else:
            pytest.importorskip("gdown")
            publish(server, files)
            redirect(monkeypatch, server)
        place = Place(tmp_path / "data", said.append, patience=Patience(5, 2, 0))
        return bring(catalogue.expand(f"set/{scene}")[0], catalogue.read()["set"], place, force)

    fetch.said, fetch.root = said, tmp_path / "data"
    return fetch


def publish(server, files):
    """The pages that Google shows of the folder and its files."""
    server.files.clear()
    if files is None:
        return
    tree: dict = {}
    for path, data in files.items():
        *folders, name = path.split("/")
        place = tree
        for folder in folders:
            place = place.setdefault(folder, {})
        place[name] = data

    def page(tree, identity, title):
        links = []
        for number, (name, value) in enumerate(tree.items()):
            inner = f"{identity[:20]}-{number:03d}-{abs(hash(name)) % 10**9:09d}"
            if isinstance(value, dict):
                links.append(f'<a href="https://drive.google.com/drive/folders/{inner}">{name}</a>')
                page(value, inner, name)
            else:
                links.append(f'<a href="https://drive.google.com/file/d/{inner}/view?usp=drive_web">{name}</a>')
                headers = {"Content-Disposition": f'attachment; filename="{name}"'} if value is not QUOTA else {}
                server.serve(f"/uc?id={inner}", value, headers={**headers, "Content-Type": "text/html"})
        text = f"<html><head><title>{title}</title></head><body>{''.join(links)}</body></html>"
        server.serve(f"/embeddedfolderview?id={identity}", text.encode(), headers={"Content-Type": "text/html"})

    page(tree, FOLDER, "data")


def redirect(monkeypatch, server):
    import requests

    get = requests.Session.get
    monkeypatch.setattr(
        requests.Session,
        "get",
        lambda self, url, **given: get(self, url.replace("https://drive.google.com", server.url("")), **given),
    )
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
        monkeypatch.delenv(name, raising=False)


def contents(folder):
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != "download.json")
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def packed(files, prefix=""):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in files.items():
            archive.writestr(prefix + name, data)
    return buffer.getvalue()


def below(prefix, files=SCENE):
    return {prefix + name: data for name, data in files.items()}


def test_the_stand_in_is_called_as_gdown_is():
    gdown = pytest.importorskip("gdown")
    for name in ("download", "download_folder"):
        ours = inspect.signature(getattr(StandIn({}), name)).parameters
        real = inspect.signature(getattr(gdown, name)).parameters
        assert [(key, value.default) for key, value in ours.items()] == [
            (key, value.default) for key, value in real.items()
        ]


def test_a_folder_of_the_scene_is_fetched_file_by_file(drive):
    files = {**below("data/indoortraj/kitchen_1/"), **below("data/indoortraj/kitchen_2/"), "readme.txt": b"hello"}
    assert contents(drive(files)) == SCENE


@pytest.mark.parametrize(
    ("name", "prefix"),
    [("x/kitchen_1.zip", ""), ("kitchen_1.zip", "kitchen_1/"), ("set.zip", "processed/kitchen_1/")],
)
def test_an_archive_is_unpacked(drive, name, prefix):
    assert contents(drive({"note.txt": b"x", name: packed(SCENE, prefix)})) == SCENE
    kept = list((drive.root / ".viewbench" / "archives").iterdir())
    assert len(kept) == (name == "set.zip"), "an archive of several scenes is kept for the others"
    changed = {**SCENE, "train/c.jpg": b"\xff\xd8new"}
    with pytest.raises(UserError, match="was changed on the server or on the way"):
        drive({"note.txt": b"x", name: packed(changed, prefix)}, force=True)
    (drive.root / ".viewbench" / "hashes.json").unlink()
    assert contents(drive({"note.txt": b"x", name: packed(changed, prefix)}, force=True)) == changed


def test_a_file_that_google_refuses_is_said_with_what_to_do_by_hand(drive):
    with pytest.raises(
        UserError, match=r"Google Drive refuses 'c.jpg'.*Too many users.*tomorrow, or by hand: open"
    ) as e:
        drive({**below("kitchen_1/"), "kitchen_1/train/c.jpg": QUOTA})
    assert str(drive.root / "set" / "kitchen_1") in str(e.value)
    assert not (drive.root / "set" / "kitchen_1").exists()
    there = set(contents(drive.root / "set" / ".part-kitchen_1"))
    assert there >= {"train/a b.jpg"}
    assert contents(drive(below("kitchen_1/"))) == SCENE, "the next call goes on"


def test_a_page_in_place_of_an_archive_is_named(drive):
    with pytest.raises(UserError, match=r'web page \("Log in to the network"\) in place of .*kitchen_1.zip'):
        drive({"kitchen_1.zip": PAGE})
    assert contents(drive({"kitchen_1.zip": packed(SCENE)})) == SCENE


def test_a_folder_that_is_closed_or_has_something_else_is_said(drive):
    with pytest.raises(UserError, match=r"status code 404.*or by hand"):
        drive(None)
    with pytest.raises(UserError, match=r"neither 'kitchen_1/' nor an archive of it, but a.txt, b.txt; or by hand"):
        drive({"a.txt": b"", "b.txt": b"x"})


def test_no_file_of_the_folder_leaves_the_scene(drive, tmp_path, request):
    if "stand-in" not in request.node.name:
        pytest.skip("gdown itself makes names harmless")
    with pytest.raises(UserError, match="leaves the folder"):
        drive({**below("kitchen_1/"), "kitchen_1/../../evil.jpg": b"evil"})
    assert not list(tmp_path.rglob("evil*"))


def test_without_gdown_the_line_to_type_is_said(tmp_path, monkeypatch):
    from viewbench.common import extras

    (tmp_path / "catalogue.toml").write_text(TEXT, encoding="utf-8")
    monkeypatch.setenv(catalogue.VARIABLE, str(tmp_path / "catalogue.toml"))
    monkeypatch.setattr(extras.importlib.util, "find_spec", lambda name, *rest: None)
    with pytest.raises(UserError, match=r"pip install 'viewbench\[download\]'"):
        bring(catalogue.expand("set/kitchen_1")[0], catalogue.read()["set"], Place(tmp_path, print))
