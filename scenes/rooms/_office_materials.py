"""Materials that only `open_office` has, and the textures of all that it uses."""

from collections.abc import Callable, Iterable

import numpy as np

from . import _office_city, _office_pictures, _office_screens, _office_textures
from ._materials import MATERIALS, textures
from ._office_textures import boards, tweed
from ._types import VERTEX_COLOUR, Material

OFFICE_TEXTURES: dict[str, Callable[[], np.ndarray]] = {
    "carpet": _office_textures.carpet,
    "chevron": _office_textures.chevron,
    "mineral": _office_textures.mineral,
    "concrete": _office_textures.concrete,
    "felt": _office_textures.felt,
    "whitewash": _office_textures.whitewash,
    "tweed_grey": lambda: tweed(280, "4d565e", "a9b2b8"),
    "tweed_blue": lambda: tweed(282, "23405a", "6f9bb8"),
    "tweed_gold": lambda: tweed(284, "8a6420", "e2b650"),
    "kelim": _office_textures.kelim,
    "zinc": _office_textures.zinc,
    "city": _office_city.city,
    "oak": lambda: boards(286, "a98255", "e6cb9e"),
    "birch": lambda: boards(290, "c2a77f", "efe0c4"),
    "smoked": lambda: boards(294, "33302d", "7a6d60"),
    "screens": _office_screens.screens,
    "papers": _office_pictures.papers,
    "posters": _office_pictures.posters,
    "binders": _office_pictures.binders,
    "keys": _office_pictures.keys,
    "whiteboard": _office_pictures.whiteboard,
    "pegs": _office_pictures.pegs,
    "prism": _office_pictures.prism,
}

OFFICE_MATERIALS = {
    **{name: MATERIALS[name] for name in ("books", "letters", "leaf", "steel", "paint", "glaze", "chrome", "glass")},
    **{name: Material("diffuse", name) for name in OFFICE_TEXTURES},
    "chevron": Material("glossy", "chevron", 0.3),
    "birch": Material("glossy", "birch", 0.35),
    "whiteboard": Material("glossy", "whiteboard", 0.2),
    "zinc": Material("metal", "zinc", 0.3),
    "radiator": Material("glossy", "zinc", 0.3),
    "black": Material("glossy", VERTEX_COLOUR, 0.3),
    "city": Material("light", "city", strength=1.2),
    "screens": Material("light", "screens", strength=0.75),
    "prism": Material("light", "prism", strength=0.98),
}


def office_textures(materials: Iterable[Material]) -> dict[str, np.ndarray]:
    """The textures that these materials name, each made anew."""
    given = list(materials)
    named = {material.colour for material in given if isinstance(material.colour, str)}
    return textures(given) | {name: make() for name, make in OFFICE_TEXTURES.items() if name in named}
