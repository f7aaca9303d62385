"""Starting points: what the chosen views may know of a scene."""

from dataclasses import replace

import numpy as np
import pytest

from viewbench.backends._seeding import seed_points
from viewbench.common.errors import UserError

RNG = np.random.default_rng(0)


def test_selected_points_are_those_that_two_chosen_views_see(take_views):
    chosen = tuple(range(0, 400, 8))
    views = take_views(chosen=chosen, seen_by=True)
    xyz, rgb, record = seed_points(views, "selected", RNG, 10)
    kept = [len(set(chosen) & set(track.tolist())) >= 2 for track in views.points.seen_by]
    assert 0 < sum(kept) < len(kept)
    assert np.array_equal(xyz, views.points.xyz[kept])
    assert np.array_equal(rgb, views.points.rgb[kept])
    assert record == {"points": "selected", "count": sum(kept), "of": 200}


def test_random_points_lie_around_all_training_cameras_whichever_were_chosen(take_views):
    views = take_views()
    draws = [seed_points(views, "random", np.random.default_rng(4), 500)[0] for _ in range(2)]
    assert np.array_equal(*draws)
    low, high = views.training.positions.min(axis=0), views.training.positions.max(axis=0)
    margin = 0.5 * (high - low).max()
    assert np.all((draws[0] >= low - margin) & (draws[0] <= high + margin))
    assert np.array_equal(draws[0], seed_points(take_views((5, 7)), "random", np.random.default_rng(4), 500)[0])
    alone = replace(views, training=views.training[:1])
    assert np.ptp(seed_points(alone, "random", RNG, 50)[0], axis=0).min() > 0, "one camera has a box too"


def test_points_that_are_not_there_are_explained(take_views):
    views = take_views()
    with pytest.raises(UserError, match="no points to start from; set points=random"):
        seed_points(replace(views, points=None), "scene", RNG, 1)
    with pytest.raises(UserError, match="no point tracks"):
        seed_points(views, "selected", RNG, 1)
    lonely = replace(views.points, seen_by=tuple(np.array([0]) for _ in range(200)))
    with pytest.raises(UserError, match="is seen from 2 of the 3 chosen views"):
        seed_points(replace(views, points=lonely), "selected", RNG, 1)
