"""Test views as rendered from each selector's model, beside the ground truth."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..common.errors import UserError
from ..scenes.image_files import open_image
from . import _figures
from ._items import Item
from ._statistics import number
from ._study import FULL, Cell, Study, percent

ORDER = 40
VIEWS = 3  # test views shown per scene
SIZE = 1.55  # inches of a picture's width


def build(study: Study, out: Path) -> list[Item]:
    """One strip per backend and scene, at the middle ratio and the first seed."""
    return [item for panel in study.panels() if (item := _strip(study, *panel, out)) is not None]


def _strip(study: Study, backend: str, scene: str, out: Path) -> Item | None:
    found = study.find(backend, scene, ratio=study.middle_ratio(backend), seed=study.first_seed)
    by_selector = {cell.selector: cell for cell in found if cell.selector != FULL}
    cells = [by_selector[name] for name in study.selectors if name in by_selector]
    full = study.full(backend, scene)
    cells += [full] if full is not None else []
    views = {cell.selector: cell.read("metrics")["views"] for cell in cells}
    if not cells or not views[cells[0].selector]:
        return None
    total = len(views[cells[0].selector])
    other = next((cell for cell in cells if len(views[cell.selector]) != total), None)
    if other is not None:
        raise UserError(
            f"'{other.folder}' has not {total} scored views as '{cells[0].folder}' has; run the study again"
        )
    chosen = sorted({(2 * place + 1) * total // (2 * VIEWS) for place in range(VIEWS)})
    # The truth is optional, and so is its column.
    truth = study.folder / "scenes" / scene
    has_truth = all((truth / Path(views[cells[0].selector][index]["file"]).name).is_file() for index in chosen)
    columns = int(has_truth) + len(cells)
    records: list[dict[str, Any]] = []
    with _figures.look():
        first = _picture(cells[0].folder / views[cells[0].selector][chosen[0]]["file"])
        height = SIZE * first.shape[0] / first.shape[1]
        figure, axes = _figures.grid(columns * len(chosen), SIZE, height + 0.22, columns=columns)
        for row, index in enumerate(chosen):
            places = axes[row * columns : (row + 1) * columns]
            name = views[cells[0].selector][index]["name"]
            if has_truth:
                file = Path(views[cells[0].selector][index]["file"]).name
                _show(places[0], _picture(truth / file), "ground truth" if row == 0 else "", _short(name))
            for place, cell in zip(places[int(has_truth) :], cells, strict=True):
                view = views[cell.selector][index]
                score = "" if view["psnr_db"] is None else f"{number(view['psnr_db'], 1)} dB"
                _show(place, _picture(cell.folder / view["file"]), _title(cell) if row == 0 else "", score)
                records.append(_record(backend, cell, view))
        figure.set_layout_engine("constrained", w_pad=0.02, h_pad=0.02, wspace=0, hspace=0)
        suffix = f"_{backend}" if len(study.backends) > 1 else ""
        files = _figures.save(figure, out, f"renders_{scene}{suffix}", records)
    share = percent(study.middle_ratio(backend))
    caption = (
        f"{study.label(backend, scene)} at {share} of the views, seed {study.first_seed}: {len(chosen)} test views, "
        "evenly spaced in the test split and not chosen by score, with the PSNR of each picture. One seed each: a "
        "single picture says little about a selector."
    )
    return Item(f"Test views of {study.label(backend, scene)}", "figure", caption, files)


def _title(cell: Cell) -> str:
    return f"all {cell.count} views" if cell.selector == FULL else cell.selector


def _short(name: str) -> str:
    """The end of a frame's name, which tells frames apart."""
    name = "".join(character if character.isprintable() else " " for character in name)
    return name if len(name) <= 22 else "…" + name[-21:]


def _picture(path: Path) -> np.ndarray:
    """(H, W, 3) uint8."""
    with open_image(path) as image:
        return np.asarray(image.convert("RGB"))


def _show(axes: Axes, picture: np.ndarray, title: str, below: str) -> None:
    axes.imshow(picture)
    axes.set(xticks=[], yticks=[])
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_title(title, fontsize=8.5, pad=3)
    axes.set_xlabel(below, fontsize=7.5, labelpad=2, loc="left", color=_figures.GREY)


def _record(backend: str, cell: Cell, view: dict[str, Any]) -> dict[str, Any]:
    return {
        "backend": backend,
        "scene": cell.scene,
        "selector": cell.selector,
        "ratio": cell.ratio,
        "seed": cell.seed,
        **{key: view[key] for key in ("name", "psnr_db", "ssim", "lpips")},
    }
