"""The pictures of a training: a bounded part of them in memory, the rest in a file without a name.

A training reads its pictures over and over, in an order that is drawn anew each round, so that it does not matter which
are kept: the first are, until the limit is reached. The rest lies beside the training, in a file whose name is removed
before anything is written to it, so that it goes with the process, however that ends. It is read by position and not
mapped: pages of a mapping would count as memory of the process.
"""

import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import UserError
from ..scenes.images import Picture

KEPT_BYTES = 512 << 20  # of pictures in memory


class Pictures:
    """K pictures of one size, as `images` of a TrainingSet; to be closed, which `with` does."""

    def __init__(self, pictures: Iterable[Picture], shape: tuple[int, int, int], folder: Path, kept: int):
        """Reads all of them, of `shape` (H, W, 3), with at most `kept` bytes in memory and the rest in `folder`.

        Raises UserError where the folder has no room for it.
        """
        self._kept: list[Picture] = []
        self._places: list[tuple[int, np.dtype, int]] = []  # of the others: where in the file, dtype, `one`
        self._file: Any = None
        self._size = shape
        self._folder = folder
        used = end = 0
        try:
            for picture in pictures:
                size = picture.numbers.nbytes
                if not self._places and used + size <= kept:
                    self._kept.append(picture)
                    used += size
                else:
                    self._write(picture, end)
                    end += size
        except BaseException:
            self.close()
            raise

    def _write(self, picture: Picture, place: int) -> None:
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=self._folder, buffering=0)  # noqa: SIM115 - `close` closes it
            left = np.ascontiguousarray(picture.numbers).data.cast("B")
            at = place
            while len(left):
                written = os.pwrite(self._file.fileno(), left, at)
                left, at = left[written:], at + written
        except OSError as error:
            raise UserError(
                f"training pictures that memory is not kept for cannot be written to '{self._folder}': "
                f"{error.strerror or error}; free some space or train at a smaller width"
            ) from None
        self._places.append((place, picture.numbers.dtype, picture.one))

    @property
    def shape(self) -> tuple[int, ...]:
        """(K, H, W, 3)."""
        return (len(self), *self._size)

    def __len__(self) -> int:
        return len(self._kept) + len(self._places)

    def __getitem__(self, index: int) -> np.ndarray:
        """(H, W, 3) float32 in [0, 1], new."""
        index = range(len(self))[index]
        if index < len(self._kept):
            return self._kept[index].pixels()
        place, kind, one = self._places[index - len(self._kept)]
        numbers = np.empty(self._size, kind)
        left = numbers.data.cast("B")
        while len(left):
            read = os.preadv(self._file.fileno(), [left], place)
            if not read:
                raise UserError(f"the pictures beside the training in '{self._folder}' were cut short; train again")
            left, place = left[read:], place + read
        return Picture(numbers, one).pixels()

    def __iter__(self) -> Iterator[np.ndarray]:
        return (self[index] for index in range(len(self)))

    def __array__(self, dtype: Any = None, /, *, copy: bool | None = None) -> np.ndarray:
        """All of them at once, (K, H, W, 3), for a program that needs it so."""
        if copy is False:
            raise ValueError("pictures are no array: they can only be copied to one")
        images = np.empty(self.shape, np.float32 if dtype is None else dtype)
        for image, pixels in zip(images, self, strict=True):
            image[:] = pixels
        return images

    def close(self) -> None:
        """Lets go of the pictures and of the file, which vanishes."""
        if self._file is not None:
            self._file.close()
        self._kept, self._places, self._file = [], [], None

    def __enter__(self) -> "Pictures":
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()
