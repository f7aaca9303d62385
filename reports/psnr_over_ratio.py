"""Test PSNR over the ratio of views trained on, per scene (the form of the paper's Figure 4)."""

from pathlib import Path

from . import _curves, _figures
from ._items import Item
from ._study import FULL, Study, failures_note
from ._style import styles

ORDER = 10
NAME = "psnr_over_ratio"


def build(study: Study, out: Path) -> list[Item]:
    """One panel per scene and backend: mean over seeds, one standard deviation, and the full-data line."""
    panels = study.panels()
    if not panels:
        return []
    present = {cell.selector for cell in study.done}
    drawn = styles(name for name in (*study.selectors, FULL) if name in present)
    with _figures.look():
        figure, axes = _figures.grid(len(panels), 4.3, 3.5)
        for place, (backend, scene) in zip(axes, panels, strict=True):
            _curves.draw(place, study.find(backend, scene), drawn)
            place.set_title(study.label(backend, scene))
        _figures.share_heights(axes)
        _figures.legend(figure, drawn)
        files = _figures.save(figure, out, NAME, _curves.records(study.done))
    return [Item("PSNR over ratio", "figure", _caption(study), files)]


def _caption(study: Study) -> str:
    counts = {item.n for key, item in _all_summaries(study).items() if key[1] != FULL}
    seeds = max(counts)
    text = "Mean PSNR over all test views; higher is better. "
    if seeds > 1:
        text += f"Bars: one sample standard deviation over up to {seeds} seeds (filled markers). "
    if 1 in counts:
        text += "Hollow markers are one sample, which has no spread to show. "
    if any(cell.selector == FULL for cell in study.done):
        text += "Dashed: the mean of models trained on all training views with the same budget. "
    text += "At a ratio the selectors stand side by side so that their bars can be told apart."
    return text + failures_note(study)


def _all_summaries(study: Study) -> dict:
    return {
        (panel, *key): item for panel in study.panels() for key, item in _curves.summaries(study.find(*panel)).items()
    }
