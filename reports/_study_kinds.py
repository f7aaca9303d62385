"""Whether study.json and scenes/NAME.json have what reports take from them, of the kinds that viewbench writes."""

from typing import Any

TEXTS = ("name", "title", "description")
LISTS: dict[str, type | tuple[type, ...]] = {
    "scenes": str,
    "selectors": dict,
    "ratios": (int, float),
    "seeds": int,
    "backends": dict,
}
NAMED: dict[str, dict[str, type]] = {  # entries of these lists: what they have, by its kind
    "selectors": {"name": str, "selector": str},
    "backends": {"name": str},
}
GRID = {"selectors": str, "ratios": (int, float)}

FIGURE = (int, float, type(None))
CURVE = dict.fromkeys(("step", "seconds", "test_psnr_db"), FIGURE)
VIEW: dict[str, Any] = {"name": str, "file": str, "psnr_db": FIGURE, "ssim": FIGURE, "lpips": FIGURE}


def check_kinds(record: Any) -> None:
    """Raises KeyError, with its name, for a part that the record lacks or that is of another kind."""
    if not isinstance(record, dict):
        raise KeyError("everything")
    for key in TEXTS:
        if not isinstance(record[key], str):
            raise KeyError(key)
    for key, kind in LISTS.items():
        _check_list(record[key], kind, key)
    for key, parts in NAMED.items():
        for entry in record[key]:
            if not all(isinstance(entry.get(name), kind) for name, kind in parts.items()):
                raise KeyError(key)
    for entry in record["backends"]:
        grid = entry.get("grid", {})
        if not isinstance(grid, dict):
            raise KeyError("grid")
        for key, kind in GRID.items():
            _check_list(grid.get(key, []), kind, "grid")


def check_scene(record: Any) -> None:
    """Raises KeyError, with its name, for a part that the description of a scene lacks or that is of another kind."""
    if not isinstance(record, dict):
        raise KeyError("everything")
    for key in ("n_train", "n_test"):
        if not isinstance(record[key], int):
            raise KeyError(key)
    for key in ("room", "walk"):
        if not isinstance(record.get(key) or "", str):
            raise KeyError(key)
    for key, part in (("train", "positions"), ("train", "forward"), ("test", "positions")):
        _check_rows(record[key][part], 3, part)
    _check_rows(record["points"] or [], 6, "points")
    _check_list(record.get("seen") or [], (int, float), "seen")


def check_record(name: str, record: Any) -> None:
    """Raises KeyError, with its name, for a part of a cell's selection, train or metrics that is of another kind."""
    if not isinstance(record, dict):
        raise KeyError("everything")
    if name == "selection":
        _check_list(record.get("indices", []), int, "indices")
    parts, key = {"train": (CURVE, "curve"), "metrics": (VIEW, "views")}.get(name, ({}, ""))
    entries = record.get(key, [])
    _check_list(entries, dict, key)
    for entry in entries:
        if not all(isinstance(entry.get(part), kind) for part, kind in parts.items()):
            raise KeyError(key)
    if name == "train" and not isinstance(record.get("gpu") or {"shared": None}, dict):
        raise KeyError("gpu")


def _check_rows(rows: Any, length: int, key: str) -> None:
    _check_list(rows, list, key)
    for row in rows:
        _check_list(row, (int, float), key)
        if len(row) != length:
            raise KeyError(key)


def _check_list(values: Any, kind: type | tuple[type, ...], key: str) -> None:
    if not isinstance(values, list) or not all(isinstance(value, kind) for value in values):
        raise KeyError(key)
