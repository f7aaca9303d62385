"""Materials of `open_office` by name: its own, and those that it takes from what rooms share."""

from . import _furniture, _materials, _office_city, _office_pictures, _office_screens, _office_textures
from ._materials import Texture
from ._office_textures import boards, tweed
from ._types import VERTEX_COLOUR, Material

TEXTURES: dict[str, Texture] = {
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

MATERIALS = {
    **_materials.MATERIALS,
    **{name: Material("diffuse", name) for name in TEXTURES},
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


def cell(k: int, columns: int, rows: int) -> tuple[float, float, float, float]:
    """The part of an office texture that the k-th of `columns` x `rows` pictures takes, for what stands upright."""
    return _furniture.cell(k, columns, rows, (0.002, 0.004))
