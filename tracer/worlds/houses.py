"""Houses: timber frames, plaster of many colours, glazed windows, gabled roofs, a lamp inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tracer.worlds.canvas import Canvas

Side = Literal["north", "south", "east", "west"]


@dataclass(frozen=True, kw_only=True)
class House:
    """Where a house stands and how it is built.

    Args:
        at: low corner of the walls, x and z.
        ground: first layer of air.
        size: voxels along x and z.
        storeys: one or two.
        wall: material of the walls.
        roof: material of the roof.
        door: the side that the door is on.
        ridge: the axis that the roof's ridge follows.
    """

    at: tuple[int, int]
    ground: int
    size: tuple[int, int]
    storeys: int = 1
    wall: str = "plaster"
    roof: str = "roof_clay"
    door: Side = "south"
    ridge: Literal["x", "z"] = "x"


STOREY = 7


def build(canvas: Canvas, house: House) -> None:
    """Put up a house."""
    (x0, z0), y0 = house.at, house.ground
    x1, z1 = x0 + house.size[0], z0 + house.size[1]
    top = y0 + STOREY * house.storeys
    canvas.box((x0 - 1, y0 - 3, z0 - 1), (x1 + 1, y0, z1 + 1), "masonry_dark")
    canvas.box((x0, y0, z0), (x1, top, z1), "air")
    canvas.box((x0, y0 - 1, z0), (x1, y0, z1), "planks")
    canvas.shell((x0, y0, z0), (x1, top, z1), house.wall)
    canvas.shell((x0, y0, z0), (x1, y0 + 1, z1), "masonry")
    for storey in range(house.storeys):
        _frame(canvas, house, y0 + storey * STOREY)
        _windows(canvas, house, y0 + storey * STOREY, leave_door=storey == 0)
        _furnish(canvas, house, y0 + storey * STOREY)
    _roof(canvas, house, top)
    _door(canvas, house)
    canvas.box((x0 + 2, top, z0 + 2), (x0 + 4, top + 8, z0 + 4), "masonry_dark")
    canvas.box((x0 + 2, top + 8, z0 + 2), (x0 + 4, top + 9, z0 + 4), "masonry")


def _frame(canvas: Canvas, house: House, y: int) -> None:
    (x0, z0), top = house.at, y + STOREY
    x1, z1 = x0 + house.size[0], z0 + house.size[1]
    for x in (x0, x1 - 1):
        for z in (z0, z1 - 1):
            canvas.box((x, y, z), (x + 1, top, z + 1), "timber")
    canvas.shell((x0, top - 1, z0), (x1, top, z1), "timber")
    if y > house.ground:
        canvas.shell((x0, y, z0), (x1, y + 1, z1), "timber")
        canvas.box((x0 + 1, y - 1, z0 + 1), (x1 - 1, y, z1 - 1), "planks")


def _windows(canvas: Canvas, house: House, y: int, *, leave_door: bool) -> None:
    """Windows two wide and three high with a sill below and shutters beside."""
    (x0, z0), (w, d) = house.at, house.size
    for side in ("north", "south", "east", "west"):
        along_x = side in ("north", "south")
        length = w if along_x else d
        middle = length // 2
        spots = (middle - 4, middle + 3) if length >= 12 else ((middle - 1,) if length < 9 else (2, length - 4))
        for s in spots:
            if leave_door and side == house.door and abs(s + 1 - middle) < 3:
                continue
            depth = {"north": z0, "south": z0 + d - 1, "west": x0, "east": x0 + w - 1}[side]
            out = -1 if side in ("north", "west") else 1
            for name, lo, hi, a, b, off in (
                ("timber", s - 1, s + 3, 1, 2, out),
                ("timber", s - 1, s, 2, 5, 0),
                ("timber", s + 2, s + 3, 2, 5, 0),
                ("glass", s, s + 2, 2, 5, 0),
            ):
                p, q = (x0 if along_x else z0) + lo, (x0 if along_x else z0) + hi
                if along_x:
                    canvas.box((p, y + a, depth + off), (q, y + b, depth + off + 1), name)
                else:
                    canvas.box((depth + off, y + a, p), (depth + off + 1, y + b, q), name)


def _furnish(canvas: Canvas, house: House, y: int) -> None:
    (x0, z0), (w, d) = house.at, house.size
    canvas.put(x0 + w // 2, y + STOREY - 2, z0 + d // 2, "lamp")
    canvas.box((x0 + 2, y, z0 + 2), (x0 + 5, y + 2, z0 + 4), "planks")
    canvas.box((x0 + w - 4, y, z0 + 1), (x0 + w - 1, y + 4, z0 + 2), "cloth_red" if w % 2 else "cloth_blue")


def _roof(canvas: Canvas, house: House, top: int) -> None:
    """A gabled roof that overhangs by one, with gables in the wall's material."""
    (x0, z0), (w, d) = house.at, house.size
    span = d if house.ridge == "x" else w
    for i in range(span // 2 + 2):
        y = top - 1 + i
        low, high = i - 2, span + 2 - i
        if high - low <= 0:
            break
        for a in {low, high - 1}:
            if house.ridge == "x":
                canvas.box((x0 - 1, y, z0 + a), (x0 + w + 1, y + 1 + (high - low <= 2), z0 + a + 1), house.roof)
            else:
                canvas.box((x0 + a, y, z0 - 1), (x0 + a + 1, y + 1 + (high - low <= 2), z0 + d + 1), house.roof)
        inner = (low + 1, high - 1)
        if i >= 1 and inner[0] < inner[1]:
            if house.ridge == "x":
                for x in (x0, x0 + w - 1):
                    canvas.box((x, y, z0 + max(inner[0], 0)), (x + 1, y + 1, z0 + min(inner[1], d)), house.wall)
            else:
                for z in (z0, z0 + d - 1):
                    canvas.box((x0 + max(inner[0], 0), y, z), (x0 + min(inner[1], w), y + 1, z + 1), house.wall)


def _door(canvas: Canvas, house: House) -> None:
    """A door two wide, a step before it, a lamp over it."""
    (x0, z0), (w, d), y = house.at, house.size, house.ground
    if house.door in ("north", "south"):
        x, z = x0 + w // 2 - 1, z0 if house.door == "north" else z0 + d - 1
        out = -1 if house.door == "north" else 1
        canvas.box((x - 1, y, z), (x + 3, y + 6, z + 1), "timber")
        canvas.box((x, y, z), (x + 2, y + 5, z + 1), "planks")
        canvas.box((x - 1, y - 1, z + out), (x + 3, y, z + out + 1), "masonry")
        canvas.box((x, y + 6, z + out), (x + 2, y + 7, z + out + 1), "timber")
        canvas.put(x - 2, y + 4, z + out, "lamp")
    else:
        x, z = x0 if house.door == "west" else x0 + w - 1, z0 + d // 2 - 1
        out = -1 if house.door == "west" else 1
        canvas.box((x, y, z - 1), (x + 1, y + 6, z + 3), "timber")
        canvas.box((x, y, z), (x + 1, y + 5, z + 2), "planks")
        canvas.box((x + out, y - 1, z - 1), (x + out + 1, y, z + 3), "masonry")
        canvas.box((x + out, y + 6, z), (x + out + 1, y + 7, z + 2), "timber")
        canvas.put(x + out, y + 4, z - 2, "lamp")
