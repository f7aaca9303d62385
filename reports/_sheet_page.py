"""Lays a contact sheet out as a page that needs nothing beside it and no network."""

import base64
import html
import io
from pathlib import Path
from typing import Any

from ._contact_sheet import Part, Progress, Sheet, thumbnails
from ._strip import CHOSEN

SIZE = 240  # pixels of the longer side of a picture
STYLE = f"""
body {{ font: 13px/1.4 system-ui, sans-serif; color: #1f1f1f; background: white; margin: 24px; }}
h1 {{ font-size: 22px; }} h2 {{ font-size: 17px; margin: 28px 0 2px; }} p {{ color: #6a6a6a; margin: 0 0 10px; }}
section {{ display: flex; flex-wrap: wrap; gap: 12px; align-items: flex-end; }}
figure {{ margin: 0; width: 160px; }}
figure img {{ display: block; max-width: 160px; max-height: 160px; margin: auto; }}
figure img:hover {{ outline: 2px solid {CHOSEN}; }}
figcaption div {{ display: flex; height: 1.4em; justify-content: space-between; gap: 6px; }}
figcaption span {{ display: block; overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }}
b {{ color: {CHOSEN}; }} small {{ color: #6a6a6a; }}
.pair {{ display: flex; gap: 6px; align-items: flex-end; border: 1px solid #dadada; padding: 5px; }}
"""


def write(path: Path, sheet: Sheet, frames: dict[int, Path], progress: Progress) -> None:
    """Writes the sheet as HTML with its pictures in it."""
    pictures = {index: _uri(image) for index, image in thumbnails(frames, SIZE, progress).items()}
    title = html.escape(sheet.title)
    lines = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        f"<title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>",
        *(_part(part, pictures) for part in sheet.parts),
        "</body></html>",
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", errors="replace", newline="\n")


def _part(part: Part, pictures: dict[int, str]) -> str:
    figures = []
    for card in part.cards:
        name, words, mark = (html.escape(text) for text in (card.name, card.words, card.mark))
        below = f"<div><small>{words}</small><b>{mark}</b></div>"
        caption = f'<figcaption><span title="{name}">{name}</span>{below}</figcaption>'
        figures.append(f'<figure><img src="{pictures[card.index]}" alt="{name}">{caption}</figure>')
    if part.pairs:
        both = zip(figures[::2], figures[1::2], strict=True)
        figures = [f'<div class="pair">{left}{right}</div>' for left, right in both]
    heading = f"<h2>{html.escape(part.title)}</h2><p>{html.escape(part.words)}</p>"
    return "\n".join([heading, "<section>", *figures, "</section>"])


def _uri(image: Any) -> str:
    buffer = io.BytesIO()
    image.save(buffer, format="JPEG", quality=80)
    return f"data:image/jpeg;base64,{base64.b64encode(buffer.getvalue()).decode()}"
