"""The page: one file, well formed, that needs no network and says what the numbers say."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from tests.conftest import known
from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.reports import _findings, _page, _run, _study
from viewbench.reports._statistics import signed

from .fixtures import make_study

VOID = {"meta", "link", "img", "br"}
ODD = '<script>alert(1)</script> & "quotes"'


class Page(HTMLParser):
    """Attributes of all elements, the text, and whether every element is closed."""

    def __init__(self):
        super().__init__()
        self.open, self.elements, self.text, self.ids = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        self.ids += [value for name, value in attributes if name == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] not in ("style", "script"):
            self.text.append(data)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = make_study(tmp_path_factory.mktemp("page"), title=ODD, failed=[(None, "room_smooth", "random", 0.2, 0)])
    for name in plugins.names("reports"):
        _run.run(folder, name)
    _run.page(folder)
    return folder


@pytest.fixture(scope="module")
def page(folder):
    parsed = Page()
    parsed.feed((folder / "reports" / "index.html").read_text(encoding="utf-8"))
    return parsed


def test_it_is_well_formed(page):
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert sum(tag == "h1" for tag, _ in page.elements) == 1


def test_it_needs_nothing_from_the_network(folder, page):
    html = (folder / "reports" / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"https?:|//cdn|@import|url\(", html)
    for tag, attributes in page.elements:
        if "src" in attributes:
            assert attributes["src"].startswith("data:image/")
        assert not (tag == "link" and not attributes["href"].startswith("data:"))


def test_it_is_no_larger_than_a_few_megabytes(folder):
    assert (folder / "reports" / "index.html").stat().st_size < 4e6


def test_links_lead_somewhere(folder, page):
    for tag, attributes in page.elements:
        if tag == "a":
            target = attributes["href"]
            assert target[1:] in page.ids if target.startswith("#") else (folder / "reports" / target).is_file()


def test_names_are_escaped(page):
    assert ODD in "".join(page.text)
    assert sum(tag == "script" for tag, _ in page.elements) == 1


def test_pictures_say_what_they_are(page):
    images = [attributes for tag, attributes in page.elements if tag == "img"]
    assert images
    assert all(attributes["alt"] and int(attributes["width"]) > 0 for attributes in images)


def test_what_was_run_and_what_failed_is_told(page):
    text = " ".join("".join(page.text).split())
    for words in ("79 of 80 cells scored", "1,500 iterations at width 128", "0123456789ab", "ran out of memory"):
        assert words in text


def test_it_is_the_same_when_made_again(folder):
    path = folder / "reports" / "index.html"
    before = path.read_bytes()
    _run.page(folder)
    assert path.read_bytes() == before


def test_findings_follow_the_numbers(folder):
    study = _study.load(folder)
    to_uniform = _findings.headline(study)[0]
    assert to_uniform.startswith("maxmin is better than uniform on room_human (+0.")
    assert "cannot be told apart from uniform by these seeds on room_smooth" in to_uniform
    details = _findings.details(study)
    assert len(details) == 2
    assert "Its mean is the highest" in details[0]
    full = known(study.full("splat", "room_human"))
    assert f"all {full.count} views ({full.psnr_db:.2f} dB)" in details[0]


def test_every_difference_carries_its_interval(tmp_path):
    """On all ratios, on each, and to the models of all views; by scipy's Welch test for comparison."""
    from scipy.stats import ttest_ind

    study = _study.load(make_study(tmp_path, scenes=("room_human",), seeds=(3, 5, 8, 9), everything_repeats=True))

    def expected(ours, theirs):
        bounds = ttest_ind(ours, theirs, equal_var=False).confidence_interval(0.95)
        mean = sum(ours) / len(ours) - sum(theirs) / len(theirs)
        return signed(mean), f"{signed(bounds.low)} to {signed(bounds.high)}"

    def scores(selector, ratio):
        return [known(cell.psnr_db) for cell in study.find(selector=selector, ratio=ratio)]

    (details,) = _findings.details(study)
    for ratio in study.ratios:
        mean, bounds = expected(scores("maxmin", ratio), scores("uniform", ratio))
        assert f"{mean} ({bounds}) at {ratio * 100:g} %" in details
    mean, bounds = expected(scores("maxmin", 0.2), scores("full", 1.0))
    all_views = f"4 models trained on all 400 views ({np.mean(scores('full', 1.0)):.2f} dB)"
    assert f"{all_views} is {mean} dB (95 % interval {bounds})." in details
    over = [np.mean([scores(name, ratio) for ratio in study.ratios], axis=0).tolist() for name in ("maxmin", "uniform")]
    mean, bounds = expected(*over)
    assert f"({mean} dB, {bounds})" in _findings.headline(study)[0]


def test_a_backend_with_a_part_of_the_ratios_is_judged_by_them(tmp_path):
    part = {"some": {"ratios": [0.05, 0.2]}}
    folder = make_study(tmp_path, scenes=("room_human",), backends=("splat", "some"), grids=part)
    study = _study.load(folder)
    assert (study.ratios_of("splat"), study.ratios_of("some")) == ((0.05, 0.1, 0.2), (0.05, 0.2))
    whole, some = _findings.details(study)
    assert "over the ratios 5 %, 10 % and 20 %" in whole
    assert "over the ratios 5 % and 20 %" in some
    for name in study.record["reports"]:
        _run.run(folder, name)
    _run.page(folder)
    assert (folder / "reports" / "renders_room_human_some.png").is_file()


def test_a_study_without_maxmin_is_told_about_its_best(tmp_path):
    study = _study.load(make_study(tmp_path, scenes=("room_human",), selectors=("random", "coverage", "logdet")))
    assert _findings.subject_of(study) == "logdet"
    assert _findings.headline(study)[0].startswith("logdet is better than random")


def test_one_seed_draws_no_conclusion(tmp_path):
    study = _study.load(make_study(tmp_path, scenes=("room_human",), seeds=(0,)))
    assert all("single sample" in sentence for sentence in _findings.headline(study))


def test_a_page_of_nothing_is_refused(tmp_path):
    with pytest.raises(UserError, match="no report of"):
        _run.page(make_study(tmp_path, scenes=("room_human",)))


def test_seeds_that_not_every_selector_has_are_not_promised(tmp_path):
    study = _study.load(make_study(tmp_path))  # whose reference has one seed
    words = f"{len(study.seeds)} seeds"
    assert f"× up to {words}" in _page._grid_words(study)
    assert f"× {words}" in _page._grid_words(replace(study, cells=study.find("splat", study.scenes[0], "random", 0.1)))
