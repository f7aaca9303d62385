"""Reads the vertices of a PLY file, whatever its head claims and whatever follows them."""

import io
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from ..common import bounded, limits

KINDS = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2"},
    **{"uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
MOST_PROPERTIES = 256  # a Gaussian of degree 3 has 62
NUMBER_LETTERS = 32  # of one in text, with the space before it


class _Element(NamedTuple):
    name: str
    count: int
    properties: list[tuple[str, str]]  # name and numpy's kind, "" of a list


def vertices(path: Path, most: int = limits.POINTS) -> np.ndarray:
    """(N,) structured array of the element "vertex", N at most `most`; elements behind it are not looked at.

    Raises OSError for a file that is missing or no file, ValueError for one that is no PLY file, that has fewer
    vertices in it than its head claims, and for what `limits` does not allow.
    """
    size = bounded.checked(path)
    with open(path, "rb") as file:
        order, elements = _head(file)
        skipped = 0
        for element in elements:
            if element.name == "vertex":
                return _vertices(file, order, element, skipped, size, most)
            if order == "=" and element.count <= limits.LINES:
                for _ in range(element.count):  # one line each
                    file.readline(limits.LINE_LETTERS)
                continue
            if order == "=" or any(not kind for _, kind in element.properties):
                raise ValueError(f"its element '{element.name[:40]}' comes before the vertices; write these first")
            skipped += element.count * np.dtype(element.properties).itemsize
    raise ValueError("it has no element 'vertex'")


def _head(file: BinaryIO) -> tuple[str, list[_Element]]:
    """Byte order and the elements in order; the file is left at the first byte behind its head."""
    order, elements, found = "", [], 0
    if file.readline(16).strip() != b"ply":
        raise ValueError("it does not begin with 'ply'")
    while True:
        line = file.readline(limits.PLY_HEADER_BYTES)
        found += len(line)
        if not line.endswith(b"\n") or found > limits.PLY_HEADER_BYTES:
            raise ValueError(f"its head does not end within {limits.PLY_HEADER_BYTES:,} bytes")
        words = line.decode("ascii", errors="replace").split()
        if words[:1] == ["end_header"]:
            break
        if words[:1] == ["format"] and len(words) == 3 and words[1] in ORDERS:
            order = ORDERS[words[1]]
        elif words[:1] == ["element"] and len(words) == 3 and words[2].isascii() and words[2].isdecimal():
            if len(words[2]) > 18:
                raise ValueError(f"its head claims {words[2][:18]}… of '{words[1][:40]}'")
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[:1] == ["property"] and elements:
            elements[-1].properties.append(_property(words))
        elif words[:1] not in ([], ["comment"], ["obj_info"]):
            raise ValueError(f"its head has a line '{' '.join(words)[:40]}'")
    if not order:
        raise ValueError("its head does not say in which format it is")
    for element in elements:
        names = [name for name, _ in element.properties]
        if len(names) > MOST_PROPERTIES or len(set(names)) < len(names):
            raise ValueError(f"its element '{element.name[:40]}' has a property twice, or more than {MOST_PROPERTIES}")
    return order, elements


def _property(words: list[str]) -> tuple[str, str]:
    if len(words) == 3 and words[1] in KINDS:
        return words[2], KINDS[words[1]]
    if len(words) == 5 and words[1] == "list":
        return words[4], ""
    raise ValueError(f"its head has a line '{' '.join(words)[:40]}'")


def _vertices(file: BinaryIO, order: str, element: _Element, skipped: int, size: int, most: int) -> np.ndarray:
    """The rows of the element, whose bytes begin `skipped` after where the file is."""
    if not element.properties or any(not kind for _, kind in element.properties):
        raise ValueError("its vertices have lists, or nothing")
    table = np.dtype([(name, order + kind) for name, kind in element.properties])
    least = element.count * (table.itemsize if order != "=" else 2 * len(element.properties)) - (order == "=")
    if file.tell() + skipped + least > size:
        raise ValueError(f"its head claims {element.count:,} vertices, and fewer are in it")
    if element.count > (min(most, limits.ASCII_POINTS) if order == "=" else most) or least > limits.PLY_BYTES:
        raise ValueError(f"it has {element.count:,} vertices; thin it out (at most {most:,}, in text a tenth)")
    if order == "=":
        return _from_text(file, element, table)
    file.seek(skipped, io.SEEK_CUR)
    return np.fromfile(file, dtype=table, count=element.count)


def _from_text(file: BinaryIO, element: _Element, table: np.dtype) -> np.ndarray:
    wide = len(element.properties) * NUMBER_LETTERS
    rows = np.empty((element.count, len(element.properties)))
    for i in range(element.count):
        words = file.readline(wide).split()
        if len(words) != len(element.properties):
            raise ValueError(f"vertex {i} has not the {len(element.properties)} numbers that the head tells")
        rows[i] = [float(word) for word in words]
    result = np.empty(element.count, table)
    with np.errstate(all="ignore"):
        for k, (name, kind) in enumerate(element.properties):
            whole = kind[0] in "iu"
            if whole and not (rows[:, k] == np.round(rows[:, k])).all():
                raise ValueError(f"its property '{name[:40]}' is to be of whole numbers")
            result[name] = rows[:, k].astype(np.int64) if whole else rows[:, k]
    return result
