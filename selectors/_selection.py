"""`selection.json`: how many views, the hash of the choice, and the first K views of a greedy order."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..common import plugins
from ..common.errors import UserError, nearest
from ..common.files import content_sha256, read_json, unsealed
from ..scenes.types import Scene

# What the choice is, and not how long it took, on which version of the code, or how much each view gained.
CHOICE = ("scene", "scene_sha256", "holdout", "selector", "parameters", "seed", "n_views", "count", "indices", "names")

COUNTS = ("round", "floor")  # how a ratio becomes a number of views: ours, and the `int` of the paper's authors


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _all(value: Any, fits: Callable[[Any], bool]) -> bool:
    return isinstance(value, list) and all(map(fits, value))


# What the parts of a selection are that other code counts on, where they are there.
FORM: dict[str, Callable[[Any], bool]] = {
    "names": lambda value: _all(value, lambda name: isinstance(name, str)),
    "gains": lambda value: value is None or _all(value, lambda gain: gain is None or _is_number(gain)),
    "notes": lambda value: (
        value is None or (isinstance(value, dict) and _is_number(value.get("below_precision_from", 0)))
    ),
    "cut_from": _is_number,
    "seconds": lambda value: isinstance(value, dict) and all(map(_is_number, value.values())),
}


def count_of(ratio: float, n: int, rule: str = "round") -> int:
    """K = max(1, round(ratio · N)); halves go to the even number, as Python's `round` has it.

    With the rule "floor" it is max(1, ⌊ratio · N⌋), as the paper's authors count; the product is rounded to nine
    digits first, so that 0.29 of 100 views are 29. Raises UserError for a ratio outside (0, 1] and an unknown rule.
    """
    if not 0 < ratio <= 1:
        raise UserError(f"ratio {ratio} must lie in (0, 1]: it is the share of the {n} training views to choose")
    if rule not in COUNTS:
        raise UserError(f"unknown rule of counting '{rule}'{nearest(rule, COUNTS)} (there are: {', '.join(COUNTS)})")
    share = ratio * n
    return max(1, round(share) if rule == "round" else math.floor(round(share, 9)))


def is_greedy(selector: str, parameters: dict[str, Any]) -> bool:
    """Whether the views that a selector chooses for a smaller count are the first of those for a larger one."""
    return bool(plugins.constant("selectors", selector, "GREEDY", False)) and not parameters.get("sample")


def load_selection(path: Path) -> dict[str, Any]:
    """Reads `selection.json`; raises UserError when it is none, or was edited since it was made."""
    selection = read_json(path, "selection")
    if not isinstance(selection, dict) or not isinstance(selection.get("indices"), list):
        raise UserError(f"'{path}' is no selection; make one with `viewbench select`")
    odd = next((key for key, fits in FORM.items() if key in selection and not fits(selection[key])), None)
    if odd is not None:
        raise UserError(f"selection '{path}' has a {odd} that is none; make it with `viewbench select`")
    return unsealed(selection, f"selection '{path}'")


def selection_sha256(selection: dict[str, Any]) -> str:
    """Hex SHA-256 of the choice: equal on every machine that chooses the same views of the same scene."""
    return content_sha256({key: selection.get(key) for key in CHOICE})


def first_views(selection: dict[str, Any], count: int) -> dict[str, Any]:
    """The selection of the first `count` views in the order chosen, what a greedy selector would have chosen for it.

    Its seconds stay those of the whole order, whose length stands in `cut_from`. Raises UserError for a count that
    the order does not have, and for a selection that is not greedy, whose first views are no choice.
    """
    have = len(selection["indices"])
    if not 1 <= count <= have:
        raise UserError(f"the selection has {have} views, so it cannot give the first {count}; select that many")
    if count == have:
        return selection
    if not selection.get("greedy"):
        raise UserError(
            f"the first {count} of {have} views by '{selection.get('selector')}' are not its choice of {count}; "
            f"select {count}"
        )
    cut = {**selection, "count": count, "cut_from": selection.get("cut_from", have)}
    for key in ("indices", "names", "gains"):
        cut[key] = None if cut.get(key) is None else cut[key][:count]
    notes = dict(selection.get("notes") or {})
    notes.pop("auto", None)  # it is about the whole of it
    if notes.get("below_precision_from", -1) >= count:  # nothing happened there yet
        for key in ("below_precision_from", "precision"):
            notes.pop(key, None)
    cut.pop("notes", None)
    return {**cut, "notes": notes} if notes else cut


def check_selection(selection: dict[str, Any], scene: Scene, scene_sha256: str) -> np.ndarray:
    """(K,) int64 indices of the selection into the scene's training split.

    Raises UserError when the selection was made on another scene, or on this one when it was different: another
    hash, length or names, indices out of range. A selection that somebody else made need not have the hash.
    """
    try:
        indices = np.asarray(selection["indices"], dtype=np.int64)
        n_views, names = int(selection["n_views"]), list(selection["names"])
        _ = selection["selector"], selection["seed"]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise UserError(f"the selection lacks or garbles {error}; make it with `viewbench select`") from None
    made_on = selection.get("scene_sha256", scene_sha256)
    if made_on != scene_sha256:
        raise UserError(
            f"the selection was made on scene '{selection.get('scene')}' with holdout "
            f"'{selection.get('holdout')}' and hash {str(made_on)[:12]}, but '{scene.name}' has holdout "
            f"'{scene.holdout}' and hash {scene_sha256[:12]}; give the capture that it was made of, or select again"
        )
    if n_views != len(scene.train):
        raise UserError(
            f"the selection was made of {n_views} views, scene '{scene.name}' has {len(scene.train)}; select again"
        )
    if indices.ndim != 1 or len(names) != len(indices):
        raise UserError("the selection's indices must be a list with a name for each; select again")
    if len(indices) == 0 or indices.min() < 0 or indices.max() >= n_views or len(set(indices.tolist())) != len(indices):
        raise UserError(f"the selection's indices must be distinct and in [0, {n_views - 1}]; select again")
    for index, name in zip(indices, names, strict=True):
        if scene.train.names[index] != name:
            raise UserError(
                f"the selection calls view {index} '{name}', the scene '{scene.train.names[index]}'; select again"
            )
    return indices
