"""The catalogue that ships: every entry is complete and well-formed, and every name resolves."""

import dataclasses
import json
import sys
import urllib.parse
import zipfile
from pathlib import Path

import pytest

from viewbench.common import catalogue, plugins
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes.download import hashes
from viewbench.scenes.download.http import kind_of
from viewbench.scenes.download.unpack import safe
from viewbench.scenes.formats import tum_rgbd
from viewbench.scenes.load import open_scene
from viewbench.scenes.splits import held_out
from viewbench.scenes.whereabouts import absence

SHIPPED = catalogue.read()
SCENES = {scene.name: scene for data in SHIPPED.values() for scene in data.scenes.values()}
SETTINGS = settings_file.load(settings_file.PACKAGE / settings_file.FILE)


def is_address(text):
    parts = urllib.parse.urlsplit(text)
    return parts.scheme in ("http", "https") and "." in parts.netloc and " " not in text


@pytest.mark.parametrize("data", SHIPPED.values(), ids=SHIPPED)
def test_a_data_set_says_what_it_is_and_under_what_terms(data):
    for text in (data.title, data.citation, data.source, data.licence.name, data.licence.says, data.group):
        assert text.strip()
    assert is_address(data.home)
    assert is_address(data.licence.address)
    assert data.format in plugins.names("scenes.formats")
    if data.holdout:
        held_out(data.holdout, 100)
    assert bool(data.scenes) or data.by_hand, "who cannot be downloaded says how to be had"
    assert bool(data.drive) <= bool(data.by_hand), "a shared folder can close"


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_a_scene_says_where_it_is_and_what_it_becomes(scene):
    data = SHIPPED[scene.dataset]
    if scene.archive is None:
        assert len(data.drive) >= 25
    else:
        assert is_address(scene.archive.address)
        assert kind_of(scene.archive.address) in ("zip", "tgz")
        assert scene.archive.bytes == int(scene.archive.bytes) >= 0
    assert scene.prefix.endswith("/")
    for name in (scene.prefix, *scene.also, scene.path):
        safe(name, "catalogue")
    entry = SETTINGS.entry(scene.name)
    assert entry == settings_file.SceneEntry(scene.path, data.group, data.holdout, data.format)
    assert catalogue.find(scene.name.replace("/", ".")) == scene
    assert catalogue.at(scene.path) == scene
    assert catalogue.expand(scene.name) == [scene]
    if data.format == "tum-rgbd":
        assert any(camera in scene.folder for camera in tum_rgbd.CAMERAS), "the reader knows the camera by the folder"


def test_no_two_scenes_lie_in_one_folder_and_no_unused_archive_is_kept():
    assert len({scene.path for scene in SCENES.values()}) == len(SCENES)
    raw = catalogue.tomllib.loads(catalogue.FILE.read_text(encoding="utf-8"))
    for name, values in raw.items():
        used = {given["archive"] for given in values.get("scenes", {}).values() if "archive" in given}
        assert used == set(values.get("archives", {})), name


def test_the_hashes_that_ship_are_of_addresses_of_the_catalogue():
    known = {scene.archive.address for scene in SCENES.values() if scene.archive}
    shipped = json.loads(hashes.SHIPPED.read_text(encoding="utf-8"))
    assert set(shipped) <= known
    assert all(len(sha256) == 64 for record in shipped.values() for sha256 in record.values())


def test_the_scenes_that_studies_ship_with_can_be_brought(monkeypatch, tmp_path):
    entry = SETTINGS.scenes["kitchen_1"]
    scene = catalogue.at(entry.path)
    assert scene is not None
    assert scene.name == "indoortraj/kitchen_1"


def test_it_is_in_the_wheel(wheel):
    with zipfile.ZipFile(wheel) as archive:
        for file in (catalogue.FILE, hashes.SHIPPED):
            assert archive.read(f"viewbench/scenes/{file.name}") == file.read_bytes()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mipnerf360/rom", "has no scene 'rom'; did you mean 'room'"),
        ("mipnerf36", "no data set is called 'mipnerf36'; did you mean 'mipnerf360'"),
        ("room", "no data set is called 'room'; did you mean mipnerf360/room[?]"),
        ("kitchen_1", "did you mean indoortraj/kitchen_1[?]"),
        ("room1", "did you mean replica/room1 or indoortraj-replica/room1[?]"),
        ("scannet/scene0000_00", "signed agreement.* data.root/scannet/scene0000_00"),
        ("scannetpp", "kaldir.vc.in.tum.de/scannetpp"),
        ("", "no data set is called ''"),
        ("-x/y", "no data set is called '-x'"),
    ],
)
def test_a_name_that_cannot_be_brought_is_answered(name, words):
    with pytest.raises(UserError, match=words):
        catalogue.expand(name)


def test_a_data_set_is_all_its_scenes_and_says_how_much_that_is():
    assert [scene.scene for scene in catalogue.expand("replica/")] == list(SHIPPED["replica"].scenes)
    assert SHIPPED["replica"].size == "about 12.4 GB"
    assert SHIPPED["tandt"].size == "0.68 GB"
    assert SCENES["tandt/truck"].size == "a part of 0.68 GB"
    assert SCENES["tum/fr1_desk"].size == "0.34 GB"
    assert SHIPPED["tum"].size.startswith("more than")
    assert catalogue.size_in_words(2_500_000) == "2.50 MB"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[a", "not valid TOML"),
        ("[a]\ntitle = 'x'", "not as its head says: 'licence'"),
        ("[a]\nlicence = {name='', address='', says='', more=''}", "not as its head says"),
        ("a = 1", "not as its head says"),
    ],
)
def test_a_broken_catalogue_is_one_sentence(tmp_path, monkeypatch, text, words):
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    monkeypatch.setenv(catalogue.VARIABLE, str(tmp_path / "mine.toml"))
    with pytest.raises(UserError, match=words):
        catalogue.read()
    monkeypatch.setenv(catalogue.VARIABLE, str(tmp_path / "none.toml"))
    with pytest.raises(UserError, match="cannot be read"):
        catalogue.read()


def settings(root, **scenes):
    return settings_file.Settings(Path(), settings_file.Data(str(root)), {**SETTINGS.scenes, **scenes})


def test_one_line_brings_all_that_is_not_there(tmp_path):
    names = ["room_human", "kitchen_1", "kitchen_2", "hololens_space", "mipnerf360.room"]
    said = absence(names, settings(tmp_path))
    assert said is not None
    assert "`viewbench download indoortraj/kitchen_1 indoortraj/kitchen_2 mipnerf360/room` brings them" in said
    assert "not there, nor are kitchen_2, hololens_space, mipnerf360.room;" in said
    assert str(tmp_path / "indoortraj" / "kitchen_1") in said
    for scene in ("indoortraj/kitchen_1", "indoortraj/kitchen_2", "hololens_space"):
        (tmp_path / scene).mkdir(parents=True)
    said = absence(names, settings(tmp_path))
    assert said is not None
    assert "`viewbench download mipnerf360/room` brings it" in said
    assert "nor" not in said
    (tmp_path / "mipnerf360" / "room").mkdir(parents=True)
    assert absence([*names, "unheard of"], settings(tmp_path)) is None


def test_a_root_that_is_not_set_is_said_first_and_a_scene_elsewhere_is_not_offered(tmp_path):
    unset = absence(["kitchen_1", "kitchen_2"], settings(""))
    assert unset is not None
    assert "set VIEWBENCH_DATA or data.root; `viewbench download indoortraj/kitchen_1 indoortraj/kitchen_2`" in unset
    mine = settings_file.SceneEntry(str(tmp_path / "gone"))
    said = absence(["mine"], settings(tmp_path, mine=mine))
    assert said is not None
    assert "download" not in said
    assert "correct data.root or its path" in said


def test_rooms_that_are_not_rendered_are_told_apart_from_scenes_that_are_not_there(tmp_path):
    drawn = settings_file.SceneEntry("drawn", render="kitchen_living --path smooth")
    other = settings_file.SceneEntry("other")
    known = settings(tmp_path, drawn=drawn, other=other)
    with_python = dataclasses.replace(known, rooms=settings_file.Rooms(python=sys.executable))
    for names in (["drawn", "other"], ["other", "drawn"]):
        said = absence(names, known) or ""
        assert "scene 'other' should be in" in said
        assert "rendered rooms are not there (drawn)" in said
        assert "drawn" not in (absence(names, with_python, study=True) or "")
    assert absence(["drawn"], with_python, study=True) is None
    (tmp_path / "drawn" / "train").mkdir(parents=True)  # begun, and stopped
    assert "(drawn)" in (absence(["drawn"], known) or "")
    with pytest.raises(UserError, match=r"rendered rooms are not there \(drawn\)"):
        open_scene("drawn", known)
    for split in ("train", "test"):
        (tmp_path / "drawn" / f"transforms_{split}.json").write_text("{}")
    assert absence(["drawn"], known) is None


def test_a_name_of_environment_toml_comes_before_the_catalogue(tmp_path):
    mine = settings_file.SceneEntry("elsewhere", "mine")
    known = settings(tmp_path, **{"mipnerf360/room": mine})
    assert known.entry("mipnerf360/room") is mine
    assert known.dataset_of("mipnerf360/room", "") == "mine"
    assert known.dataset_of("replica/room0", "") == "replica"
    assert known.entry("nothing/room0") is None
    assert known.entry("nothing") is None
