"""log det where float64 ends, and the k-DPP sample."""

from collections import Counter

import numpy as np
import pytest

from tests.conftest import known
from tests.selectors import slow
from viewbench.common.errors import UserError
from viewbench.common.settings import load as load_settings
from viewbench.scenes.load import open_scene
from viewbench.selectors import _kdpp, _run, logdet
from viewbench.selectors._normalise import normalise
from viewbench.selectors._types import Views


def repeated(n=40, distinct=10):
    """Views of which only `distinct` differ: log det is −∞ for more."""
    views = slow.random_views(np.random.default_rng(1), n=distinct)
    some = np.arange(n) % distinct
    return Views(views.positions[some], views.rotations[some], known(views.features)[some])


def test_all_views_are_answered_and_the_end_of_precision_is_said():
    choice = logdet.select(repeated(), 40, np.random.default_rng(0))
    assert sorted(choice.indices) == list(range(40))
    assert choice.notes["below_precision_from"] == 10
    assert len({i % 10 for i in choice.indices[:10]}) == 10
    gains = known(choice.gains)
    assert (gains[10:] == np.log(choice.notes["precision"])).all()
    assert np.isfinite(gains).all()


def test_gains_do_not_grow():
    views = slow.random_views(np.random.default_rng(2), n=60)
    for regularise in (0.0, 0.1):
        gains = logdet.select(views, 60, np.random.default_rng(0), regularise=regularise).gains
        assert (np.diff(known(gains)) <= 1e-9).all()


def test_regularised_gains_are_positive_even_for_repetitions():
    choice = logdet.select(repeated(), 40, np.random.default_rng(0), regularise=0.5)
    assert "below_precision_from" not in choice.notes
    assert (known(choice.gains) > 0).all()


def test_sample_has_the_probabilities_of_the_k_dpp():
    views = slow.random_views(np.random.default_rng(5), n=6)
    m = slow.matrix(views, sigma=3.0)
    expected = slow.kdpp(m, 3)
    rows = np.linalg.cholesky(m).T
    rng, draws = np.random.default_rng(0), 8000
    found = Counter(tuple(sorted(int(i) for i in _kdpp.sample(rows, 3, rng))) for _ in range(draws))
    assert set(found) <= set(expected)
    chi_squared = sum((found[s] - draws * p) ** 2 / (draws * p) for s, p in expected.items())
    assert chi_squared < 45  # 19 degrees of freedom: exceeded once in 1,500 by a right sampler


def test_sample_is_seeded_and_answers_beyond_the_rank():
    first, again, other = (logdet.select(repeated(), 8, np.random.default_rng(s), sample=True) for s in (0, 0, 1))
    assert first.indices.tolist() == again.indices.tolist() != other.indices.tolist()
    assert len({i % 10 for i in first.indices}) == 8, "a k-DPP never draws two equal views"
    assert first.gains is None
    many = logdet.select(repeated(), 25, np.random.default_rng(0), sample=True)
    assert len(set(many.indices.tolist())) == 25
    assert many.notes["below_precision_from"] == 10


@pytest.mark.parametrize("options", [{"regularise": -1.0}, {"regularise": 0.1, "sample": True}])
def test_bad_options(options):
    with pytest.raises(UserError):
        logdet.select(repeated(), 5, np.random.default_rng(0), **options)


def test_sample_of_nearly_equal_views_is_distinct():
    views = slow.random_views(np.random.default_rng(7), n=50)
    close = Views(views.positions * 1e-4, np.repeat(views.rotations[:1], 50, axis=0), views.features)
    choice = logdet.select(close, 50, np.random.default_rng(0), factors=("pos",), sample=True)
    assert sorted(choice.indices) == list(range(50))
    assert 3 <= choice.notes["below_precision_from"] < 50


@pytest.mark.parametrize("seed", range(3))
def test_a_sample_is_less_spread_out_than_the_greedy_choice(seed):
    """Which is why the published z_DPP, a sample, says little of the greedy maximiser: on the room's own path."""
    scene = open_scene("room_human", load_settings())
    places = normalise(scene.train.cameras.positions)

    def apart(sample):
        """Mean distance of the nearest pairs among 20 views, positions in [-4, 4]."""
        parameters = {"factors": ["pos", "ang"], "sample": sample}
        chosen = places[_run.run(scene, "logdet", 20, seed, parameters)["indices"]]
        away = np.linalg.norm(chosen[:, None] - chosen, axis=2)
        return (away + 99 * np.eye(20)).min(axis=1).mean()

    assert apart(sample=True) < 0.95 * apart(sample=False)
