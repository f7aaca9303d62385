"""Runs one selector on a scene: checks what was asked, prepares the views, times the choice, makes `selection.json`."""

import functools
import hashlib
import math
import time
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from .. import __version__
from ..common import plugins
from ..common.errors import UserError, nearest
from ..common.rng import generator
from ..common.sources import code_sha256
from ..scenes.digest import scene_sha256
from ..scenes.types import UNCALIBRATED, Scene, Split
from ._normalise import normalise
from ._selection import is_greedy
from ._types import Views

PLAIN = ("random", "uniform", "full")  # selectors that compare nothing


def code_of(selector: str, format_name: str) -> str:
    """Hash of the source code that a selection by this selector, of a scene read from this format, depends on."""
    return code_sha256(*modules_of(selector), plugins.source_name("scenes.formats", format_name))


def modules_of(selector: str) -> tuple[str, str]:
    """Modules, without what they import, that a selection depends on."""
    return "selectors._run", plugins.source_name("selectors", selector)


def run(
    scene: Scene,
    selector: str,
    count: int | None,
    seed: int,
    parameters: dict[str, Any] | None = None,
    features: np.ndarray | None = None,
    sharpness: np.ndarray | None = None,
    within: float | None = None,
    candidates: np.ndarray | None = None,
    keep: Sequence[int] = (),
) -> dict[str, Any]:
    """Chooses `count` training views and returns what `selection.json` holds.

    `features` (N, D) and `sharpness` (N,) have a row per training view in capture order. `candidates` (N,) bool are the
    views that may be chosen, all by default: the others are as if the capture did not have them. The views at `keep`
    are chosen first, whatever the selector thinks of them, and the others beside them. The random generator is seeded
    by scene, selector and seed but not by the count, so that greedy orders are prefixes of each other over ratios. Test
    views are not looked at. With `within` instead of a count, that is the smallest count of a greedy order whose
    uncovered distance is no larger (`_covering`), and `auto` in the notes says both.

    Raises UserError as `checked` does, for fewer candidates than the count and for more views to keep, and for features
    or sharpness of a wrong length or with NaN.
    """
    n = len(scene.train)
    plugin, options = checked(scene, selector, count, parameters, within)
    selector = selector.replace("_", "-")
    if not scene.posed:
        options = _without_poses(scene, selector, options, features)
    if options.get("sharpness") and sharpness is None:
        raise UserError(f"'{selector}' was asked to weigh sharpness, but the sharpness of the frames was not given")
    code = code_of(selector, scene.format)  # as it is when it is loaded
    among, kept = _among(scene, count, candidates, keep)
    views = views_of(scene.train, features, sharpness, among, kept)
    begin = time.perf_counter()
    notes: dict[str, Any] = {}
    if within is None:
        choice = plugin.select(views, count, generator("select", scene.name, selector, seed), **options)
    else:
        from . import _covering  # no source: for a command's --auto alone, which no study has

        again = functools.partial(generator, "select", scene.name, selector, seed)
        choice, reached = _covering.enough(plugin, views, within, again, options)
        notes = {"auto": {"distance": within, "reached": reached}}
    elapsed = time.perf_counter() - begin
    similarity_s = choice.seconds.get("similarity", 0.0)
    if len(kept) and not set(kept) <= set(choice.indices.tolist()):
        raise UserError(f"'{selector}' does not keep views; leave --keep out, or use maxmin, logdet, uniform or random")
    indices = [int(i) for i in (choice.indices if among is None else among[choice.indices])]
    record = {
        "schema": 1,
        "scene": scene.name,
        "scene_sha256": scene_sha256(scene),
        "holdout": scene.holdout,
        "selector": selector,
        "parameters": options,
        "seed": seed,
        "n_views": n,
        "count": len(indices),
        "indices": indices,
        "names": [scene.train.names[i] for i in indices],
        "gains": None if choice.gains is None else [float(gain) for gain in choice.gains],
        "seconds": {
            "similarity": similarity_s,
            "select": choice.seconds.get("select", elapsed - similarity_s),
        },
        "features_sha256": None if views.features is None else features_sha256(views.features),
        "code_sha256": code,
        "greedy": is_greedy(selector, options),
        "viewbench": __version__,
    }
    if among is not None:
        record |= {"candidates": len(among), "kept": len(kept)}
        if features is not None:
            record["features_sha256"] = features_sha256(unit_rows(features, scene.train.names))
    notes |= choice.notes
    return record | ({"notes": notes} if notes else {})


def checked(
    scene: Scene,
    selector: str,
    count: int | None,
    parameters: dict[str, Any] | None = None,
    within: float | None = None,
) -> tuple[ModuleType, dict[str, Any]]:
    """The selector and all its parameters, as far as they can be checked before any feature is computed.

    Raises UserError for an unknown selector or parameter (with the nearest right one), a parameter of a wrong type,
    weights that are none, a count outside [1, N], and a distance `within` that it cannot choose by.
    """
    n = len(scene.train)
    if n == 0:
        raise UserError(f"scene '{scene.name}' has no training views to choose from")
    if (count is None) == (within is None):
        raise UserError("a choice takes either a count or a distance")
    if count is not None and not 1 <= count <= n:
        raise UserError(f"count {count} must lie in [1, {n}]: scene '{scene.name}' has {n} training views")
    plugin = plugins.load("selectors", selector)
    options = all_parameters(selector.replace("_", "-"), plugin.PARAMETERS, parameters or {})
    weights = {key: options[key] for key in ("alpha", "beta", "sigma", "factors") if key in options}
    if weights:
        from ._similarity import check_weights  # no source: the selector that has weights checks them again

        check_weights(**weights)
    if within is not None:
        from . import _covering  # no source: as above

        _covering.check(selector, options, within)
    return plugin, options


def _among(
    scene: Scene, count: int | None, candidates: np.ndarray | None, keep: Sequence[int]
) -> tuple[np.ndarray | None, list[int]]:
    """Indices of the views that may be chosen (None for all, with nothing to keep), and which of those are kept."""
    if candidates is None and not len(keep):
        return None, []
    allowed = np.ones(len(scene.train), dtype=bool) if candidates is None else np.array(candidates, dtype=bool)
    wanted = list(dict.fromkeys(int(i) for i in keep))
    allowed[wanted] = True
    among = np.flatnonzero(allowed)
    if count is not None and len(wanted) > count:
        raise UserError(f"count {count} is less than the {len(wanted)} views to keep; ask for more, or keep fewer")
    if len(among) < (count or 1):
        raise UserError(
            f"count {count} is more than the {len(among)} of {len(scene.train)} training views that may be chosen"
        )
    place = {int(i): k for k, i in enumerate(among)}
    return among, [place[i] for i in wanted]


def _without_poses(scene: Scene, selector: str, options: dict[str, Any], features: np.ndarray | None) -> dict[str, Any]:
    """The options for a capture that has no poses: image content is the only factor.

    Raises UserError for a selector that needs poses, and for one that compares content when there are no features.
    """
    if selector in PLAIN:
        if options.get("by") == "path":
            raise UserError(f"'{scene.name}' has no poses and so no way walked; use by=time or by=index")
        return options
    if "factors" not in options:
        raise UserError(f"'{selector}' needs poses, which '{scene.name}' does not have; use maxmin, logdet or uniform")
    if features is None:
        raise UserError(
            f"'{scene.name}' has no poses, so '{selector}' can compare image content only: "
            "name an encoder or give --features, or use uniform"
        )
    return options | {"factors": ["sem"]}


def views_of(
    train: Split,
    features: np.ndarray | None,
    sharpness: np.ndarray | None,
    among: np.ndarray | None = None,
    kept: Sequence[int] = (),
) -> Views:
    """The training views, or those `among` them alone, as selectors see them.

    Raises UserError for poses, features or sharpness with NaN.
    """
    rows = None if features is None else unit_rows(features, train.names)
    sharp = None if sharpness is None else _per_frame(sharpness, train.names)
    if among is not None:
        train = train.subset(among)
        rows, sharp = (None if values is None else values[among] for values in (rows, sharp))
    cameras = train.cameras
    bad = np.flatnonzero(~np.isfinite(cameras.c2w).all(axis=(1, 2)))
    if len(bad):
        raise UserError(f"frame '{train.names[bad[0]]}' has a pose with NaN or infinity; remove it from the capture")
    intrinsics = (cameras.fx, cameras.fy, cameras.cx, cameras.cy, cameras.width, cameras.height)
    return Views(
        positions=normalise(cameras.positions),
        rotations=np.ascontiguousarray(cameras.rotations, dtype=np.float64),
        features=rows,
        intrinsics=None if train.lens == UNCALIBRATED else np.stack(intrinsics, axis=1).astype(np.float64),
        times=train.times,
        sharpness=sharp,
        kept=np.array(kept, dtype=np.int64),
    )


def unit_rows(features: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """(N, D) float32 rows of length 1, in place of what a user or an encoder gives.

    Raises UserError for another shape than one row per name, and names the frame of a row with NaN or of zeros.
    """
    features = np.asarray(features)
    n = len(names)
    if features.ndim != 2 or len(features) != n or features.shape[1] == 0 or features.dtype.kind not in "fiu":
        raise UserError(
            f"the features are {features.dtype} of shape {features.shape}, expected numbers of shape ({n}, D): "
            f"one row per training view in capture order"
        )
    rows = np.ascontiguousarray(features, dtype=np.float32)
    lengths = np.sqrt(np.einsum("ij,ij->i", rows, rows, dtype=np.float64))
    for wrong, what in ((~np.isfinite(lengths), "NaN or infinity"), (lengths == 0, "nothing but zeros")):
        if wrong.any():
            i = int(wrong.argmax())
            raise UserError(f"row {i} of the features (frame '{names[i]}') has {what}; embed that image again")
    if np.abs(lengths - 1).max() < 1e-6:
        return rows
    return (rows / lengths[:, None]).astype(np.float32)


def features_sha256(rows: np.ndarray) -> str:
    """Hex SHA-256 of features as `unit_rows` gives them."""
    return hashlib.sha256(np.ascontiguousarray(rows, dtype=np.float32).tobytes()).hexdigest()


def _per_frame(sharpness: np.ndarray, names: Sequence[str]) -> np.ndarray:
    values = np.asarray(sharpness, dtype=np.float64)
    if values.shape != (len(names),):
        raise UserError(f"the sharpness has shape {values.shape}, expected one number for each of {len(names)} frames")
    wrong = ~(np.isfinite(values) & (values >= 0))
    if wrong.any():
        name = names[int(wrong.argmax())]
        raise UserError(f"the sharpness of frame '{name}' is {values[wrong][0]}, expected a number ≥ 0")
    return values


def all_parameters(selector: str, defaults: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """The defaults with what was given, each checked against the type of its default."""
    options = dict(defaults)
    for name, value in given.items():
        if name not in defaults:
            known = f" (it has: {', '.join(defaults)})" if defaults else "; it has none"
            raise UserError(f"'{selector}' has no parameter '{name}'{nearest(name, defaults)}{known}")
        options[name] = _checked(f"parameter '{name}' of '{selector}'", value, defaults[name])
    return options


def _checked(what: str, value: Any, default: Any) -> Any:
    if isinstance(default, bool):
        fits, expected = isinstance(value, bool), "true or false"
    elif isinstance(default, float):
        fits = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
        expected = "a number"
        value = float(value) if fits else value
    elif isinstance(default, int):
        fits, expected = isinstance(value, int) and not isinstance(value, bool), "a whole number"
    elif isinstance(default, str):
        fits, expected = isinstance(value, str), "a word"
    elif default is None or any(not isinstance(item, str) for item in default):
        return value  # the selector's own business: nothing is known of what fits
    else:
        value = list(value) if isinstance(value, (list, tuple)) else [value]
        fits, expected = all(isinstance(item, str) for item in value), "words with commas between them"
    if not fits:
        raise UserError(f"{what} is {value!r}, expected {expected}")
    return value
