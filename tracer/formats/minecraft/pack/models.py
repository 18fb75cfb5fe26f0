"""Which textures a block shows: block states, models and their parents; and where names alone must tell."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tracer.formats.minecraft.colors import tint_kind
from tracer.formats.minecraft.pack.archive import Archive, PackError

MAX_DEPTH = 32  # of parents, of names of textures that stand for one another, and of conditions
SIDES = ("west", "east", "down", "up", "north", "south")
"""The faces of a voxel in the order of `tracer.traversal.rays.Hits.face`."""
Rect = tuple[float, float, float, float]
WHOLE: Rect = (0.0, 0.0, 1.0, 1.0)
ROLES = {
    "up": ("up", "top", "end", "all", "texture", "particle", "side"),
    "down": ("down", "bottom", "end", "top", "all", "texture", "particle", "side"),
    "north": ("north", "front", "side", "all", "cross", "plant", "crop", "texture", "wall", "wool", "pane", "particle"),
}
"""Names that models give to the textures of their sides, for parents that the pack does not hold."""
FAMILIES = (
    ("(?:smooth_)?(quartz)_(?:stairs|slab)", "{1}_block"),
    ("(.*brick|.*tile)_(?:stairs|slab|wall|fence)", "{1}s"),
    ("(.*)_(?:stairs|slab|wall|fence_gate|fence|pressure_plate)", "{1}"),
    ("(.*)_(?:stairs|slab|fence_gate|fence|pressure_plate)", "{1}_planks"),
    ("(.*)_wood", "{1}_log"),
    ("(.*)_hyphae", "{1}_stem"),
    ("(?:infested|waxed|potted)_(.*)", "{1}"),
    ("(.*)_carpet", "{1}_wool"),
    ("(.*)_pane", "{1}"),
    ("(.*)_block", "{1}"),
    ("(.*)", "{1}_still"),
)
"""What a block without a texture of its own name is made of."""
LYING = {"x": (1, 1), "z": (1, 0)}
"""Quarter turns about x and y of what lies along an axis, as logs and pillars do."""
CARVED = {"carved_pumpkin", "jack_o_lantern"}
OF_ONE_TINT = {"spruce_leaves", "birch_leaves", "lily_pad", "melon_stem", "pumpkin_stem"}
"""Their pictures are grey, as those of what takes its colour from the biome."""


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One texture on a side of a model.

    Args:
        texture: its name, such as ``minecraft:block/stone``.
        tinted: whether the biome's colour is multiplied in.
        covers: the part of the side that it covers, in the side's own u and v in [0, 1], v downward.
        shows: the part of the picture that it shows there.
        turns: quarter turns of the picture, clockwise.
    """

    texture: str
    tinted: bool = False
    covers: Rect = WHOLE
    shows: Rect = WHOLE
    turns: int = 0


@dataclass(frozen=True, kw_only=True)
class Part:
    """A model as a block state places it.

    Args:
        sides: layers of each side, the lowest first; sides that show nothing are missing.
        x: quarter turns about the x axis, and then
        y: about the y axis.
        locked: pictures do not turn with the model.
    """

    sides: Mapping[str, tuple[Layer, ...]]
    x: int = 0
    y: int = 0
    locked: bool = False


def parts_of(archive: Archive, name: str, told: Mapping[str, str]) -> list[Part]:
    """The models of a block, or its textures by name; empty where the pack knows nothing of it.

    Args:
        archive: the pack.
        name: of the block, without ``minecraft:``.
        told: the properties of its state; what is not told fits anything.

    Raises:
        ValueError: a file is damaged, or parents go round in a circle.
    """
    states = archive.json(f"assets/minecraft/blockstates/{name}.json") if archive.java else None
    grey = tint_kind(name) is not None or name in OF_ONE_TINT
    placed = [] if states is None else [_part(archive, entry, grey) for entry in _entries(states, told)]
    found = [part for part in placed if part.sides]
    if found or not (sides := _by_name(archive, name, told, grey)):
        return found
    x, y = LYING.get(told.get("axis", ""), (0, 0))
    return [Part(sides=sides, x=x, y=y)]


def _entries(states: Mapping[str, Any], told: Mapping[str, str]) -> Iterator[Mapping[str, Any]]:
    """What a block state shows: its variant, or all parts that fit; of alternatives the first."""
    variants, multipart = states.get("variants"), states.get("multipart")
    chosen: list[Any] = []
    if isinstance(variants, dict):
        pairs = [
            ({k: v for k, _, v in (p.partition("=") for p in key.split(",")) if k}, e) for key, e in variants.items()
        ]
        chosen = [entry for wanted, entry in pairs if _fits(wanted, told)][:1]
    elif isinstance(multipart, list):
        cases = [case for case in multipart if isinstance(case, dict)]
        chosen = [case.get("apply") for case in cases if _fits(case.get("when", {}), told)]
    for entry in chosen:
        first = entry[0] if isinstance(entry, list) and entry else entry
        if isinstance(first, dict):
            yield first


def _fits(wanted: Any, told: Mapping[str, str], depth: int = 0) -> bool:
    if not isinstance(wanted, dict) or depth > MAX_DEPTH:
        return False
    if isinstance(any_of := wanted.get("OR"), list):
        return any(_fits(case, told, depth + 1) for case in any_of)
    if isinstance(all_of := wanted.get("AND"), list):
        return all(_fits(case, told, depth + 1) for case in all_of)
    values = {key: str(value).lower() for key, value in wanted.items()}
    return all(told.get(key, value.split("|")[0]) in value.split("|") for key, value in values.items())


def _part(archive: Archive, entry: Mapping[str, Any], grey: bool) -> Part:
    x, y = (int((_numbers([entry.get(axis, 0)], 1) or [0.0])[0] * 16) // 90 % 4 for axis in ("x", "y"))
    sides = _sides(archive, str(entry.get("model", "")), grey)
    return Part(sides=sides, x=x, y=y, locked=entry.get("uvlock") is True)


def _sides(archive: Archive, model: str, grey: bool) -> dict[str, tuple[Layer, ...]]:
    textures, elements, seen = dict[str, Any](), None, list[str]()
    while model:
        if model in seen or len(seen) > MAX_DEPTH:
            raise PackError(f"pack {archive.path}: parents of model {seen[0]!r} go round in a circle, or never end")
        seen.append(model)
        space, _, path = model.rpartition(":")
        found = archive.json(f"assets/{space or 'minecraft'}/models/{path}.json")
        if found is None:
            break  # the game's own
        own = found.get("textures")
        textures = {**own, **textures} if isinstance(own, dict) else textures
        elements = found.get("elements") if elements is None else elements
        model = str(found.get("parent", ""))
    names = {key: name for key in textures if (name := _resolved(textures, key))}
    found = _of_elements(elements, names) if isinstance(elements, list) else {}
    return found or _of_roles(names, grey)


def _resolved(textures: Mapping[str, Any], key: str) -> str | None:
    for _ in range(MAX_DEPTH):
        value = textures.get(key)
        value = value.get("sprite") if isinstance(value, dict) else value
        if not isinstance(value, str) or not value.startswith("#"):
            return value if isinstance(value, str) else None
        key = value[1:]
    return None


def _of_roles(names: Mapping[str, str], grey: bool) -> dict[str, tuple[Layer, ...]]:
    found = {}
    for side in SIDES:
        roles = (side, *ROLES.get(side, ROLES["north"]))
        if texture := next((names[role] for role in roles if role in names), None):
            found[side] = (Layer(texture=texture, tinted=grey),)
    return found


def _of_elements(elements: list[Any], names: Mapping[str, str]) -> dict[str, tuple[Layer, ...]]:
    """Layers of each side: those of the first element that has it, and of others in the same place."""
    found: dict[str, list[Layer]] = {}
    for element in elements:
        faces = element.get("faces") if isinstance(element, dict) else None
        for side, face in faces.items() if isinstance(faces, dict) else ():
            texture = names.get(str(face.get("texture", "")).lstrip("#")) if isinstance(face, dict) else None
            if texture is None or not isinstance(face, dict) or side not in SIDES:
                continue
            covers = _covered(side, _numbers(element.get("from"), 3), _numbers(element.get("to"), 3))
            shows = _numbers(face.get("uv"), 4)
            layer = Layer(
                texture=texture,
                tinted="tintindex" in face,
                covers=covers,
                shows=covers if shows is None else (shows[0], shows[1], shows[2], shows[3]),
                turns=int((_numbers([face.get("rotation", 0)], 1) or [0.0])[0] * 16 // 90) % 4,
            )
            if side not in found or found[side][0].covers == covers:
                found.setdefault(side, []).append(layer)
    return {side: tuple(layers) for side, layers in found.items()}


def _numbers(values: Any, count: int) -> list[float] | None:
    """Sixteenths as numbers up to 1, or None where they are no ``count`` numbers."""
    if not isinstance(values, list) or len(values) != count:
        return None
    fine = all(isinstance(n, (int, float)) and abs(n) < 1e4 for n in values)
    return [float(n) / 16 for n in values] if fine else None


def side_uv(side: str, x: Any, y: Any, z: Any) -> tuple[Any, Any]:
    """A place on a side of a block, all in [0, 1], as u and v of a picture that is not turned, v downward."""
    return {
        "up": (x, z),
        "down": (x, 1 - z),
        "north": (1 - x, 1 - y),
        "south": (x, 1 - y),
        "west": (z, 1 - y),
        "east": (1 - z, 1 - y),
    }[side]


def _covered(side: str, low: list[float] | None, high: list[float] | None) -> Rect:
    if low is None or high is None:
        return WHOLE
    (u0, v0), (u1, v1) = side_uv(side, *low), side_uv(side, *high)
    return min(u0, u1), min(v0, v1), max(u0, u1), max(v0, v1)


def _by_name(archive: Archive, name: str, told: Mapping[str, str], grey: bool) -> dict[str, tuple[Layer, ...]]:
    """Layers by the names that the game gives to textures, for packs without models."""
    kin = [name, *(to.replace("{1}", m[1]) for pattern, to in FAMILIES if (m := re.fullmatch(pattern, name)))]
    lit = ("_front_on",) if told.get("lit") == "true" else ()
    front = f"block/{name}" if name in CARVED else _first(archive, name, *lit, "_front")
    for one in ("pumpkin", name) if name in CARVED else kin:
        around = _first(archive, one, "_side", "", "_front", "_top")
        if around is None:
            continue
        over = _first(archive, one, "_side_overlay")
        top = _first(archive, one, "_top", "_end", "") or around
        down = _first(archive, "dirt", "") if name == "grass_block" else _first(archive, one, "_bottom", "_end", "_top")
        soil = name == "grass_block"  # only its blades take the biome's colour
        sides = (Layer(texture=around, tinted=grey and not soil), *(Layer(texture=o, tinted=True) for o in [over] if o))
        return {
            **dict.fromkeys(SIDES, sides),
            "up": (Layer(texture=top, tinted=grey),),
            "down": (Layer(texture=down or around, tinted=grey and not soil),),
            **({told["facing"]: (Layer(texture=front),)} if front and told.get("facing") in SIDES else {}),
        }
    return {}


def _first(archive: Archive, name: str, *endings: str) -> str | None:
    return next((f"block/{name}{end}" for end in endings if archive.has_picture(f"block/{name}{end}")), None)
