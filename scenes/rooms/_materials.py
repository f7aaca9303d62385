"""Materials that rooms share, by name, and the texture that each name of one stands for."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from . import _cloth, _pictures, _surfaces
from ._types import VERTEX_COLOUR, Material

Texture = Callable[[], np.ndarray]  # makes it: (H, W, 3) uint8, sRGB

TEXTURES: dict[str, Texture] = {
    "floor": _surfaces.planks,
    "wallpaper": _surfaces.wallpaper,
    "plaster": _surfaces.plaster,
    "brick": _surfaces.brick,
    "tiles": _surfaces.tiles,
    "ceiling": _surfaces.ceiling,
    "wood_dark": lambda: _surfaces.wood(20, "2e1a0e", "6b4226"),
    "wood_light": lambda: _surfaces.wood(21, "9c7242", "d9b27c"),
    "wood_red": lambda: _surfaces.wood(22, "5a1f14", "a4512f"),
    "marble": _surfaces.marble,
    "rug": _cloth.rug,
    "plaid": _cloth.plaid,
    "cushion": _cloth.cushion,
    "art": _pictures.art,
    "books": _pictures.books,
    "letters": _pictures.letters,
    "outside": _surfaces.outside,
    "leaf": _surfaces.leaf,
    "steel": _surfaces.steel,
}

MATERIALS = {
    "floor": Material("glossy", "floor", 0.25),
    "wallpaper": Material("diffuse", "wallpaper"),
    "plaster": Material("diffuse", "plaster"),
    "brick": Material("diffuse", "brick"),
    "tiles": Material("glossy", "tiles", 0.12),
    "ceiling": Material("diffuse", "ceiling"),
    "wood_dark": Material("diffuse", "wood_dark"),
    "wood_light": Material("diffuse", "wood_light"),
    "wood_red": Material("glossy", "wood_red", 0.2),
    "marble": Material("glossy", "marble", 0.06),
    "rug": Material("diffuse", "rug"),
    "plaid": Material("diffuse", "plaid"),
    "cushion": Material("diffuse", "cushion"),
    "art": Material("diffuse", "art"),
    "books": Material("diffuse", "books"),
    "letters": Material("diffuse", "letters"),
    "leaf": Material("diffuse", "leaf"),
    "steel": Material("metal", "steel", 0.25),
    "paint": Material("diffuse", VERTEX_COLOUR),
    "glaze": Material("glossy", VERTEX_COLOUR, 0.1),
    "chrome": Material("metal", (0.9, 0.9, 0.9), 0.05),
    "mirror": Material("mirror", (0.93, 0.93, 0.93)),
    "glass": Material("glass"),
    "outside": Material("light", "outside", strength=1.6),
    "panel": Material("light", (1.0, 0.93, 0.82), strength=24.0),
    "bulb": Material("light", (1.0, 0.75, 0.45), strength=40.0),
}


def textures(materials: Iterable[Material], own: Mapping[str, Texture] | None = None) -> dict[str, np.ndarray]:
    """The textures that these materials name, each made anew; a room's `own` go before those that rooms share."""
    named = {material.colour for material in materials if isinstance(material.colour, str)}
    return {name: make() for name, make in {**TEXTURES, **(own or {})}.items() if name in named}
