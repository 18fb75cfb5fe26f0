"""Where to look from: named viewpoints and camera paths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gbufrt.camera import Camera
from gbufrt.names import unknown
from gbufrt.numeric import check_function, check_numbers


@dataclass(frozen=True, eq=False, kw_only=True)
class View:
    """A named viewpoint or camera path: ``camera(time)`` gives eye and target in world space."""

    eye: Callable[[float], Sequence[float]]
    target: Callable[[float], Sequence[float]]
    fov_y: float = 60.0
    description: str = ""
    by_day: bool = False
    """Where by night nothing is seen, as under water."""

    def __post_init__(self) -> None:
        for name in ("eye", "target"):
            fixed = f"of the time in seconds that returns x, y, z (for a fixed one {name}=lambda time: (0.0, 5.0, 9.0))"
            check_function(name, getattr(self, name), fixed)
        check_numbers(fov_y=self.fov_y)
        if not 0 < self.fov_y < 180:
            raise ValueError(f"fov_y must lie between 0 and 180 degrees, got {self.fov_y}")

    def camera(self, time: float = 0.0, *, size: tuple[int, int], near: float = 0.05, far: float = 1000.0) -> Camera:
        """The camera at ``time`` seconds; ``size`` is ``(H, W)``."""
        return Camera.look_at(self.eye(time), self.target(time), size=size, fov_y=self.fov_y, near=near, far=far)


class Views(dict[str, View]):
    """Views by name. Of a name that is not there `[]` tells those that are."""

    def __missing__(self, name: str) -> View:
        raise KeyError(unknown("view", name, "the scene", self))
