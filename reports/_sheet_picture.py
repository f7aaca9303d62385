"""Lays a contact sheet out as one picture."""

import math
from pathlib import Path
from typing import Any

from ._contact_sheet import Card, Part, Progress, Sheet, thumbnails
from ._strip import CHOSEN
from ._thumbnails import font, shortened

WIDTH = 1920  # pixels of all columns, without the margins
MARGIN, GAP, PAD = 24, 10, 5
INK, GREY, PAPER = "#1F1F1F", "#6A6A6A", "white"
FEW, MANY = 8, 16  # columns
TALLEST = 16_000  # pixels that every kind of file can have


class Page:
    """Places cards from the top of a picture downwards, first to measure it and then to draw."""

    def __init__(self, size: int, pictures: dict[int, Any]):
        from PIL import Image, ImageDraw

        self.size, self.pictures = size, pictures
        self.title, self.head, self.text = font(28), font(20), font(13)
        self.image = Image.new("RGB", (1, 1))
        self.pen = ImageDraw.Draw(self.image)

    def draw(self, sheet: Sheet) -> Any:
        """The picture of the sheet."""
        from PIL import Image, ImageDraw

        height = self._parts(sheet)
        self.image = Image.new("RGB", (WIDTH + 2 * MARGIN, height), PAPER)
        self.pen = ImageDraw.Draw(self.image)
        self._parts(sheet)
        return self.image

    def _parts(self, sheet: Sheet) -> int:
        y = self._line(MARGIN, sheet.title, self.title, INK)
        for part in sheet.parts:
            y = self._line(y + 14, part.title, self.head, INK)
            y = self._line(y, part.words, self.text, GREY)
            y = self._rows(y + 6, part)
        return y + MARGIN - GAP

    def _line(self, y: int, text: str, letters: Any, colour: str) -> int:
        self.pen.text((MARGIN, y), shortened(text, WIDTH, letters.getlength), font=letters, fill=colour)
        return y + round(1.45 * letters.size)

    def _rows(self, y: int, part: Part) -> int:
        """Cards one by one, or two by two in a box."""
        inner, outer, group = (GAP - 4, GAP + 4, 2) if part.pairs else (0, GAP, 1)  # both in the same columns
        wide = group * self.size + inner
        across = group * max(1, (WIDTH + outer) // (wide + outer))
        y += PAD if part.pairs else 0
        for start in range(0, len(part.cards), across):
            row = part.cards[start : start + across]
            tall = max(self.pictures[card.index].height for card in row)
            for place, card in enumerate(row):
                x = MARGIN + place // group * (wide + outer) + place % group * (self.size + inner)
                if part.pairs and place % 2 == 0:
                    box = (x - PAD, y - PAD, x + wide + PAD, y + tall + self._below() + PAD)
                    self.pen.rectangle(box, outline="#DADADA")
                self._card(x, y, tall, card)
            y += tall + self._below() + GAP + (2 * PAD if part.pairs else 0)
        return y

    def _below(self) -> int:
        return round(2.7 * self.text.size)

    def _card(self, x: int, y: int, tall: int, card: Card) -> None:
        picture, letters = self.pictures[card.index], self.text
        self.image.paste(picture, (x + (self.size - picture.width) // 2, y + (tall - picture.height) // 2))
        y += tall + 2
        self.pen.text((x, y), shortened(card.name, self.size, letters.getlength), font=letters, fill=INK)
        y += round(1.25 * letters.size)
        mark = letters.getlength(card.mark)
        self.pen.text((x + self.size - mark, y), card.mark, font=letters, fill=CHOSEN)
        words = shortened(card.words, self.size - mark - 4, letters.getlength)
        self.pen.text((x, y), words, font=letters, fill=GREY)


def write(path: Path, sheet: Sheet, frames: dict[int, Path], progress: Progress) -> None:
    """Writes the sheet to a .jpg, .png or .webp file; the fewer frames, the larger they are."""
    across = min(MANY, max(FEW, 2 * math.ceil(math.sqrt(1.3 * len(sheet.parts[0].cards)) / 2)))  # pairs fill rows, too
    size = (WIDTH + GAP) // across - GAP
    image = Page(size, thumbnails(frames, size, progress)).draw(sheet)
    if image.height > TALLEST:
        image = image.reduce(-(-image.height // TALLEST))
    options = {".png": {"compress_level": 6}}.get(path.suffix.lower(), {"quality": 88})
    image.save(path, **options)
