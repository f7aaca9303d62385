"""Starting points: what the chosen views may know of a scene, in the same words for every backend."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from viewbench.backends._points import SWEEP, Wanted, knowing, starting_points
from viewbench.backends._points.start import joined
from viewbench.backends._surroundings import surroundings
from viewbench.backends._types import SOURCES
from viewbench.common.errors import UserError

RNG = np.random.default_rng(0)


def points_of(data, source, rng=RNG, **how):
    """(P, 3) positions, (P, 3) colours and the record."""
    data = knowing(data, source)
    starts, seeding = starting_points(data, Wanted(source, **how), surroundings(data.training, data.points), rng)
    return *joined(starts), asdict(seeding)


def test_selected_points_are_those_that_two_chosen_views_see(take_views):
    chosen = tuple(range(0, 400, 8))
    views = take_views(chosen=chosen, seen_by=True)
    xyz, colours, record = points_of(views, "selected")
    kept = [len(set(chosen) & set(track.tolist())) >= 2 for track in views.points.seen_by]
    assert 0 < sum(kept) < len(kept)
    assert np.array_equal(xyz, views.points.xyz[kept])
    assert np.array_equal(np.round(255 * colours), views.points.rgb[kept])
    assert (record["source"], record["count"], record["scene_points"], record["of"]) == (
        "selected",
        *[sum(kept)] * 2,
        200,
    )


def test_random_points_lie_around_all_training_cameras_whichever_were_chosen(take_views):
    views = take_views()
    draws = [points_of(views, "random", np.random.default_rng(4), drawn=500)[0] for _ in range(2)]
    assert np.array_equal(draws[0], draws[1])
    low, high = views.training.positions.min(axis=0), views.training.positions.max(axis=0)
    margin = 0.5 * (high - low).max()
    assert np.all((draws[0] >= low - margin) & (draws[0] <= high + margin))
    assert np.array_equal(draws[0], points_of(take_views((5, 7)), "random", np.random.default_rng(4), drawn=500)[0])
    alone = replace(views, training=views.training[:1])
    assert np.ptp(points_of(alone, "random", drawn=50)[0], axis=0).min() > 0, "one camera has a box too"


@pytest.mark.parametrize("source", SOURCES)
def test_every_source_obeys_a_limit_and_counts_what_it_gave(take_views, source):
    views = take_views(tuple(range(0, 400, 20)), seen_by=True)
    xyz, colours, record = points_of(views, source, np.random.default_rng(1), most=120)
    assert len(xyz) == len(colours) == record["count"] <= 120
    parts = [record[f"{kind}_points"] for kind in ("scene", "sweep", "guessed", "ray", "random")]
    assert sum(parts) == record["count"]
    assert np.isfinite(xyz).all()
    assert ((colours >= 0) & (colours <= 1)).all()
    assert record["points"] == source
    assert record["of"] == (0 if source in ("sweep", "rays", "random") else 200), "it knows no points of the scene"


def test_a_trainer_that_grows_is_not_filled_at_the_start(take_views):
    """gsplat with gaussians=28000 would never densify else."""
    views = take_views(tuple(range(0, 400, 20)))
    assert points_of(views, "random", most=5000, drawn=300)[2]["count"] == 300
    assert points_of(views, "random", most=200, drawn=300)[2]["count"] == 200
    assert points_of(views, "random", most=5000, fills=True, drawn=300)[2]["count"] == 5000
    assert points_of(views, "auto", most=5000)[2]["count"] <= round(200 / (1 - SWEEP))


def test_without_a_limit_all_points_of_the_scene_come_along(take_views):
    views = take_views(tuple(range(0, 400, 20)))
    assert points_of(views, "scene", drawn=7)[2]["count"] == 200
    record = points_of(views, "auto", drawn=7)[2]
    assert record["scene_points"] == 200
    assert record["count"] <= round(200 / (1 - SWEEP))
    assert points_of(views, "rays", drawn=7)[2]["count"] == 7
    assert points_of(replace(views, points=None), "auto", drawn=7)[2]["count"] == 7


def test_points_that_are_not_there_are_explained(take_views):
    views = take_views()
    with pytest.raises(UserError, match="no points to start from; set points=sweep"):
        points_of(replace(views, points=None), "scene")
    nowhere = replace(views.points, xyz=np.full((200, 3), np.nan))
    with pytest.raises(UserError, match="no points to start from"):
        points_of(replace(views, points=nowhere), "scene")
    with pytest.raises(UserError, match="no point tracks"):
        points_of(views, "selected")
    lonely = replace(views.points, seen_by=tuple(np.array([0]) for _ in range(200)))
    with pytest.raises(UserError, match="is seen from 2 of the 3 chosen views"):
        points_of(replace(views, points=lonely), "selected")
    with pytest.raises(UserError, match="unknown source of points 'sceen'; did you mean 'scene'"):
        knowing(views, "sceen")
