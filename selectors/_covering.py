"""What a choice leaves uncovered: how far the views left out are from the nearest chosen one, and the K that is enough.

The distance of two views is their dissimilarity 1 − M. The uncovered distance D of a choice is the largest distance of
any view to the nearest chosen one (the covering radius; 0 where all are chosen). Along a greedy order D only falls.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from ..common.errors import UserError
from ..scenes.types import Scene
from . import _run
from ._nearest import Nearest
from ._selection import is_greedy
from ._similarity import Similarity, similarity
from ._types import FACTORS, Choice, Views

GROWTH = 1.5  # of the count, where a selector cannot stop by itself


class NotEnoughError(UserError):
    """Nothing short of all views is within the distance."""


def similarity_of(views: Views, parameters: Mapping[str, Any]) -> Similarity:
    """M by the weights and factors among the parameters of a selector; the paper's where it has none."""
    named = {key: parameters[key] for key in ("alpha", "beta", "sigma") if key in parameters}
    return similarity(views, **named, factors=parameters.get("factors", FACTORS))


def compared(scene: Scene, parameters: Mapping[str, Any], features: np.ndarray | None) -> Similarity | None:
    """M of the training views as a selector with these parameters sees it, by content alone where there are no poses;
    None where there is nothing to compare by."""
    if not scene.posed:
        if features is None:
            return None
        parameters = {**parameters, "factors": ["sem"]}
    return similarity_of(_run.views_of(scene.train, features, None), parameters)


def uncovered(similar: Similarity, order: Sequence[int] | np.ndarray) -> np.ndarray:
    """(K,) float64: D of the first 1, 2, … K views of the order, which are distinct."""
    nearest = Nearest(similar)
    curve = np.empty(len(order))
    for k, pick in enumerate(order):
        nearest.add(int(pick))
        curve[k] = nearest.distance.max()
    return np.maximum(curve, 0)


def nearest_chosen(similar: Similarity, chosen: Sequence[int] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) the chosen view nearest to each view and (N,) the distance to it; a chosen view's is itself, at 0."""
    nearest = Nearest(similar)
    for pick in chosen:
        nearest.add(int(pick))
    return nearest.owner, np.maximum(nearest.distance, 0)


def check(selector: str, parameters: Mapping[str, Any], within: float) -> None:
    """Raises UserError for a distance outside (0, 1), and for a selector that has no order to be cut by it."""
    if not 0 < within < 1:
        raise UserError(f"the distance of --auto is {within:g}, expected one in (0, 1): 0.05 is a similarity of 0.95")
    if "factors" not in parameters:
        raise UserError(
            f"'{selector}' does not compare views, so --auto has nothing to stop at; give --ratio or --count"
        )
    if not is_greedy(selector, dict(parameters)):
        raise UserError(
            f"'{selector}' draws another set for every count, so --auto finds no smallest one; leave out --sample, "
            "or give --ratio or --count"
        )


def enough(
    plugin: ModuleType, views: Views, within: float, rng: Callable[[], np.random.Generator], parameters: dict[str, Any]
) -> tuple[Choice, float]:
    """The first K views of a greedy selector's order, K the smallest with D ≤ `within`, and their D.

    `rng` makes the generator anew, the same each time. The order is made as far as is needed: a selector that takes
    `within` stops by itself, another is asked for so many views as `maxmin` needs, then for half as many more, again
    and again.

    Raises NotEnoughError where nothing short of all views is enough.
    """
    n = len(views)
    if "within" in inspect.signature(plugin.select).parameters:
        choice = plugin.select(views, n, rng(), within=within, **parameters)
        notes = dict(choice.notes)
        reached = notes.pop("uncovered")
        choice = Choice(choice.indices, choice.gains, choice.seconds, notes)
    else:
        count, reached = _search(plugin, views, within, rng, parameters)
        choice = plugin.select(views, count, rng(), **parameters)
    if len(choice.indices) == n:
        least = _left_alone(similarity_of(views, parameters), int(choice.indices[-1]))
        raise NotEnoughError(
            f"no choice short of all {n} views is within {within:g}: without the last of them a view is {least:.3g} "
            "away; give --auto a larger distance than that, or --count"
        )
    return choice, float(reached)


def _left_alone(similar: Similarity, i: int) -> float:
    """D of all views but i."""
    others = np.delete(similar.column(i), i)
    return max(0.0, 1 - float(others.max(initial=-np.inf))) if len(others) else 0.0


def order_within(
    scene: Scene,
    within: float,
    seed: int,
    parameters: dict[str, Any],
    features: np.ndarray | None,
    sharpness: np.ndarray | None = None,
) -> tuple[dict[str, Any], np.ndarray, Similarity]:
    """The order of `maxmin` until D ≤ `within`, all of it where nothing less is enough, as a record; its curve of D
    and the similarity that it is by. Raises UserError as `_run.run` does."""
    try:
        record = _run.run(scene, "maxmin", None, seed, parameters, features, sharpness, within=within)
    except NotEnoughError:
        record = _run.run(scene, "maxmin", len(scene.train), seed, parameters, features, sharpness)
    reached = record.get("notes", {}).pop("auto", {"reached": 0.0})["reached"]
    similar = compared(scene, record["parameters"], features)
    assert similar is not None  # else the run had refused
    if record["parameters"]["sharpness"]:  # a pick is then not always the farthest
        return record, uncovered(similar, record["indices"]), similar
    return record, np.maximum([*record["gains"][1:], reached], 0), similar


def _search(
    plugin: ModuleType, views: Views, within: float, rng: Callable[[], np.random.Generator], parameters: dict[str, Any]
) -> tuple[int, float]:
    """The smallest count of the selector's order that is enough, and its D."""
    from . import maxmin

    n, similar = len(views), similarity_of(views, parameters)
    known = {key: parameters[key] for key in ("alpha", "beta", "sigma", "factors") if key in parameters}
    asked = len(maxmin.select(views, n, rng(), within=within, **known).indices)
    nearest = Nearest(similar)
    done = 0
    while True:
        order = plugin.select(views, asked, rng(), **parameters).indices
        for pick in order[done:]:
            nearest.add(int(pick))
            done += 1
            left = float(nearest.distance.max())
            if left <= within and done >= len(views.kept):
                return done, max(0.0, left)
        asked = min(n, max(asked + 1, int(GROWTH * asked)))
