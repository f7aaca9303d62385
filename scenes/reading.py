"""Which reader opens a capture, and with what: options of a command line or of environment.toml, a format's own."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..common.errors import UserError
from ..common.settings import SceneEntry, Settings, at_home

TRAJECTORY = "trajectory"
POSED = ("poses", "intrinsics", "times")  # of a folder of images


def reader_of(
    root: Path,
    chosen: str,
    entry: SceneEntry | None,
    given: Mapping[str, Any],
    settings: Settings,
    detect: Callable[[Path], str],
) -> tuple[str, dict[str, Any]]:
    """Name of the format, `chosen` or detected, and what its reader is called with.

    `given` has options by name, None for what was not given; the scene's entry answers for those. Raises UserError for
    an option of another format.
    """
    posed = _posed(root, entry, given)
    if posed and "poses" not in posed:
        chosen = chosen or detect(root)
    if posed and chosen.replace("_", "-") not in ("", TRAJECTORY, "images"):
        raise UserError(f"poses, intrinsics and times are options of a folder of images, not of format '{chosen}'")
    chosen = TRAJECTORY if posed else chosen or detect(root)
    options: dict[str, Any] = dict(posed)
    if chosen == "transforms":
        options["allow_outside"] = bool(given.get("allow_outside")) or (entry is not None and entry.allow_outside)
    if given.get("model") is not None:
        if chosen != "colmap":
            raise UserError(f"'{root}' is in format {chosen}, which has no numbered models; leave --model out")
        options["model_number"] = given["model"]
    elif entry is not None and entry.model >= 0 and chosen == "colmap":
        options["model_number"] = entry.model
    if chosen == "video":
        options |= {"cache_gb": settings.data.video_cache_gb, **(given.get("video") or {})}
    return chosen, options


def _posed(root: Path, entry: SceneEntry | None, given: Mapping[str, Any]) -> dict[str, Any]:
    """What the reader of trajectories is told: the options, else the entry's, whose paths start at its folder."""
    told: dict[str, Any] = {}
    for key in POSED:
        listed = getattr(entry, key) if entry else ""
        if key == "intrinsics":
            told[key] = given.get(key) or listed
        elif given.get(key):
            told[key] = Path(given[key])
        elif listed:
            told[key] = root / at_home(listed)
    return {key: value for key, value in told.items() if value}
