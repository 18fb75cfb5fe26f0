"""The hall: polished floor, columns, gold, and coloured walls beside white ones; open to the plaza."""

from __future__ import annotations

from tracer.worlds.canvas import Canvas
from tracer.worlds.land import VILLAGE

LOW, HIGH = (169, 76), (204, 97)
FLOOR = VILLAGE + 3
CEILING = FLOOR + 13


def hall(canvas: Canvas) -> None:
    """Build the hall on its terrace."""
    (x0, z0), (x1, z1) = LOW, HIGH
    canvas.box((x0 - 3, FLOOR - 6, z0 - 2), (x1 + 3, FLOOR, z1 + 2), "masonry")
    canvas.box((x0 - 3, FLOOR, z0 - 3), (x1 + 3, CEILING + 12, z1 + 6), "air")
    for i in range(3):
        canvas.box((x0 + 3 - i, FLOOR - 3, z1 + 2), (x1 - 3 + i, FLOOR - 1 - i, z1 + 4 + 2 * i), "marble")
    for x in range(x0, x1):
        for z in range(z0, z1 + 2):
            dark = ((x - x0 - 1) // 3 + (z - z0) // 3) % 2
            canvas.put(x, FLOOR - 1, z, "marble_dark" if dark else "marble")
    _walls(canvas)
    _columns(canvas)
    _roof(canvas)
    _statue(canvas)
    for x in (x0 + 8, x1 - 9):
        canvas.box((x, CEILING - 3, z1), (x + 1, CEILING, z1 + 1), "iron")
        canvas.put(x, CEILING - 4, z1, "lamp")


def _walls(canvas: Canvas) -> None:
    (x0, z0), (x1, z1) = LOW, HIGH
    canvas.box((x0, FLOOR, z0), (x1, CEILING, z0 + 1), "white_wall")
    canvas.box((x0, FLOOR, z0), (x0 + 1, CEILING, z1 - 2), "red_wall")
    canvas.box((x1 - 1, FLOOR, z0), (x1, CEILING, z1 - 2), "teal_wall")
    for z in range(z0 + 4, z1 - 4, 5):  # niches to the east, arches to the west that let the evening sun in
        canvas.box((x1, FLOOR, z - 1), (x1 + 1, FLOOR + 8, z + 4), "white_wall")
        canvas.box((x1 - 1, FLOOR + 1, z), (x1, FLOOR + 6, z + 3), "air")
        canvas.put(x1 - 1, FLOOR + 1, z + 1, "copper")
        canvas.box((x0, FLOOR, z), (x0 + 1, FLOOR + 9, z + 3), "air")
        canvas.put(x0, FLOOR + 9, z + 1, "air")
    for x in (x0 + 4, x1 - 7):
        canvas.box((x, FLOOR + 4, z0), (x + 3, FLOOR + 10, z0 + 1), "glass")


def _columns(canvas: Canvas) -> None:
    x0, (x1, z1) = LOW[0], HIGH
    for x in range(x0, x1 - 1, 8):
        z = z1 - 2
        canvas.box((x, FLOOR, z), (x + 2, CEILING, z + 2), "marble")
        canvas.box((x - 1, FLOOR, z - 1), (x + 3, FLOOR + 1, z + 3), "white_wall")
        canvas.box((x - 1, CEILING - 1, z - 1), (x + 3, CEILING, z + 3), "gold")


def _roof(canvas: Canvas) -> None:
    """A low gable whose pediment, with a gilded disc, faces the plaza."""
    (x0, z0), (x1, z1) = LOW, HIGH
    canvas.box((x0 - 2, CEILING, z0 - 2), (x1 + 2, CEILING + 1, z1 + 2), "white_wall")
    canvas.box((x0 - 2, CEILING + 1, z0 - 2), (x1 + 2, CEILING + 2, z1 + 2), "masonry")
    middle = (x0 + x1) / 2
    for i in range(10):
        low, high = x0 - 3 + 2 * i, x1 + 3 - 2 * i
        if high - low < 2:
            break
        canvas.box((low, CEILING + 2 + i, z0 - 3), (high, CEILING + 3 + i, z1 + 3), "roof_clay")
        if high - low > 4:
            canvas.box((low + 2, CEILING + 2 + i, z1 + 2), (high - 2, CEILING + 3 + i, z1 + 3), "white_wall")
    canvas.box((middle - 2, CEILING + 4, z1 + 3), (middle + 2, CEILING + 8, z1 + 4), "gold")


def _statue(canvas: Canvas) -> None:
    """A gilded figure on a plinth before the white wall."""
    x, z = (LOW[0] + HIGH[0]) // 2, LOW[1] + 3
    canvas.box((x - 2, FLOOR, z - 1), (x + 3, FLOOR + 2, z + 3), "marble_dark")
    canvas.box((x - 1, FLOOR + 2, z), (x, FLOOR + 4, z + 1), "gold")
    canvas.box((x + 1, FLOOR + 2, z), (x + 2, FLOOR + 4, z + 1), "gold")
    canvas.box((x - 1, FLOOR + 4, z), (x + 2, FLOOR + 7, z + 1), "gold")
    canvas.box((x - 2, FLOOR + 5, z), (x + 3, FLOOR + 7, z + 1), "gold")
    canvas.box((x, FLOOR + 7, z), (x + 1, FLOOR + 9, z + 1), "gold")
    canvas.box((x + 3, FLOOR + 6, z), (x + 4, FLOOR + 9, z + 1), "gold")
    canvas.put(x + 3, FLOOR + 9, z, "copper")
