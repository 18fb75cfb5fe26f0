"""Cameras from a small TOML file: one, or one a frame."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import torch

from gbufrt.camera import Camera
from gbufrt.files.gbuffers.profile import is_number, read_toml

LENS = ("fov", "focal_length", "orthographic_height", "intrinsics")
MORE = ("sensor_width", "sensor_height", "pixel_aspect", "orthographic", "near", "far")
KEYS = ("number", "cut", "world_from_view", "location", "rotation", *LENS, *MORE, "convention", "up")
OPENGL = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))
Y_UP_FROM_Z_UP = torch.tensor([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=torch.float64)


@dataclass(frozen=True)
class Cameras:
    """Tables of keys by frame number; the only one, under None, holds for every frame."""

    path: Path
    tables: Mapping[int | None, Mapping[str, Any]]

    @cached_property
    def numbers(self) -> list[int]:
        """Of the frames, rising; none where one camera holds for all."""
        return sorted(number for number in self.tables if number is not None)

    def at(self, number: int, size: tuple[int, int], pixel_aspect: float = 1.0) -> Camera:
        """The camera of a frame, for a picture of ``(H, W)``.

        ``pixel_aspect``: how many times as wide as high pixels are, where the table does not say it.

        Raises:
            ValueError: the file has no such frame, or a key is missing or wrong.
        """
        table = self.tables.get(None, self.tables.get(number))
        if table is None:
            raise ValueError(f"{self.path} has no frame {number}; it has {self.numbers[0]} to {self.numbers[-1]}")
        where = f"{self.path}" if None in self.tables else f"{self.path}, frame {number}"
        return _camera(where, {"pixel_aspect": pixel_aspect, **table}, size)

    def cuts_at(self, number: int) -> bool:
        """Whether the table of a frame says that it begins another shot."""
        return self.tables.get(number, {}).get("cut", False)


def load_cameras(path: str | Path) -> Cameras:
    """Cameras from a TOML file.

    The keys of one camera stand at the top. A list ``[[frames]]`` has a ``number`` each and whatever differs from the
    top. A pose is ``world_from_view`` (four rows of four) or ``location`` with ``rotation`` (degrees about x, then y,
    then z). A lens is ``fov`` (vertical, degrees), ``focal_length`` with ``sensor_width`` or ``sensor_height``,
    ``orthographic_height`` (world units that the picture's height spans), or ``intrinsics``: three rows of three, in
    pixels, y down, pixel centres at +0.5, for shifted lenses and crops; with ``orthographic = true`` its focal lengths
    are pixels per world unit. ``pixel_aspect`` is a pixel's width over its height, by default that of the EXR file.
    ``convention`` says how view space lies: opencv (x right, y down, z forward) or opengl (x right, y up, z back).
    ``up`` is the world axis that points up, y or z. ``near`` and ``far`` are planar depths. ``cut = true`` of a frame
    says that it begins another shot.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not TOML, or a key is unknown, missing or wrong.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist; check the path")
    top = read_toml(path)
    frames = top.pop("frames", None)
    if frames is None:
        tables: dict[int | None, dict[str, Any]] = {None: top}
    else:
        if not isinstance(frames, list) or not frames or not all(isinstance(f, dict) for f in frames):
            raise ValueError(f"{path}: frames must be a list of tables, each headed [[frames]], got {frames!r}")
        tables = {}
        for frame in frames:
            number = frame.get("number")
            if not isinstance(number, int) or isinstance(number, bool) or number in tables:
                raise ValueError(f"{path}: number must be a whole number, another for each frame, got {number!r}")
            tables[number] = top | frame
    for number, table in tables.items():
        _camera(f"{path}" if number is None else f"{path}, frame {number}", table, (2, 2))
    return Cameras(path, tables)


def _camera(where: str, table: Mapping[str, Any], size: tuple[int, int]) -> Camera:
    for key in table:
        if key not in KEYS:
            raise ValueError(f"{where}: unknown key {key!r}; known are {', '.join(KEYS)}")
    if not isinstance(cut := table.get("cut", False), bool) or ("cut" in table and "number" not in table):
        raise ValueError(f"{where}: cut must be true or false, under [[frames]], got {cut!r}")
    convention, up = _choice(where, table, "convention", "opencv", "opengl"), _choice(where, table, "up", "y", "z")
    pose = _pose(where, table)
    pose = pose @ OPENGL if convention == "opengl" else pose
    pose = Y_UP_FROM_Z_UP @ pose if up == "z" else pose
    near, far = (_positive(where, table, key, default) for key, default in (("near", 0.05), ("far", 1000.0)))
    k, orthographic = _intrinsics(where, table, size)
    try:
        return Camera.from_intrinsics(k, pose.float(), size=size, near=near, far=far, orthographic=orthographic)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error


def _intrinsics(where: str, table: Mapping[str, Any], size: tuple[int, int]) -> tuple[torch.Tensor, bool]:
    """``(3, 3)``, and whether the camera is orthographic."""
    lenses = [key for key in LENS if key in table]
    if len(lenses) != 1:
        raise ValueError(f"{where} must have either fov or focal_length or {' or '.join(LENS[2:])}; write one of them")
    orthographic = table.get("orthographic", lenses == ["orthographic_height"])
    if not isinstance(orthographic, bool):
        raise ValueError(f"{where}: orthographic must be true or false, got {orthographic!r}")
    if "intrinsics" in table:
        rows = table["intrinsics"]
        if not isinstance(rows, list) or len(rows) != 3 or not all(_is_list(row, 3) for row in rows):
            raise ValueError(f"{where}: intrinsics must be three rows of three numbers, got {rows!r}")
        return torch.tensor(rows, dtype=torch.float32), orthographic
    if orthographic != (lenses == ["orthographic_height"]):
        raise ValueError(f"{where}: orthographic = true goes with intrinsics; write orthographic_height alone")
    height, width = size
    aspect = _positive(where, table, "pixel_aspect", 1.0)
    focal = height / 2 / _half_height(where, table, height / width / aspect)
    k = [[focal / aspect, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]]
    return torch.tensor(k), orthographic


def _half_height(where: str, table: Mapping[str, Any], aspect: float) -> float:
    """Half of the picture's height at depth 1, or in an orthographic one in world units; ``aspect``: height / width."""
    if "orthographic_height" in table:
        return _positive(where, table, "orthographic_height", None) / 2
    if "fov" in table:
        fov = _positive(where, table, "fov", None)
        if fov >= 180:
            raise ValueError(f"{where}: fov must lie between 0 and 180 degrees, got {fov:g}")
        return math.tan(math.radians(fov) / 2)
    focal = _positive(where, table, "focal_length", None)
    if "sensor_height" in table:
        return _positive(where, table, "sensor_height", None) / 2 / focal
    return _positive(where, table, "sensor_width", 36.0) * aspect / 2 / focal


def _pose(where: str, table: Mapping[str, Any]) -> torch.Tensor:
    if ("world_from_view" in table) == ("location" in table):
        raise ValueError(f"{where} must have either world_from_view or location with rotation; write one of them")
    if "world_from_view" in table:
        rows = table["world_from_view"]
        if not isinstance(rows, list) or len(rows) != 4 or not all(_is_list(row, 4) for row in rows):
            raise ValueError(f"{where}: world_from_view must be four rows of four numbers, got {rows!r}")
        return torch.tensor(rows, dtype=torch.float64)
    for key in ("location", "rotation"):
        if not _is_list(table.get(key), 3):
            found = f"got {table[key]!r}" if key in table else "and is missing; or write world_from_view"
            raise ValueError(f"{where}: {key} must be three numbers, {found}")
    x, y, z = (math.radians(angle) for angle in table["rotation"])
    turn = _turn(2, z) @ _turn(1, y) @ _turn(0, x)
    turn[:3, 3] = torch.tensor(table["location"], dtype=torch.float64)
    return turn


def _turn(axis: int, angle: float) -> torch.Tensor:
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[a, a] = matrix[b, b] = math.cos(angle)
    matrix[a, b], matrix[b, a] = -math.sin(angle), math.sin(angle)
    return matrix


def _is_list(value: Any, count: int) -> bool:
    return isinstance(value, list) and len(value) == count and all(is_number(v) for v in value)


def _choice(where: str, table: Mapping[str, Any], key: str, *choices: str) -> str:
    value = table.get(key, choices[0])
    if value not in choices:
        raise ValueError(f"{where}: {key} must be {' or '.join(map(repr, choices))}, got {value!r}")
    return value


def _positive(where: str, table: Mapping[str, Any], key: str, default: float | None) -> float:
    value = table.get(key, default)
    if not is_number(value) or value <= 0 or not math.isfinite(value):
        raise ValueError(f"{where}: {key} must be a positive number, got {value!r}")
    return float(value)
