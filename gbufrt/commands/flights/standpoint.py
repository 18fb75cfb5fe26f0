"""Where the camera of a flight stands: a view of the world, a place of the user's, or a file with a camera a frame."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gbufrt.commands.arguments.values import parse_point
from gbufrt.commands.flights.inside import tell_inside
from gbufrt.names import unknown

if TYPE_CHECKING:
    from gbufrt.camera import Camera
    from gbufrt.files.gbuffers.cameras import Cameras
    from tracer.scene.scene import Scene
    from tracer.scene.view import View
    from tracer.worlds.regions.stream import Stream

Point = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Standpoint:
    """Where the camera stands, frame by frame.

    Args:
        view: name of a view of the world; None for its first.
        eye: in place of a view: where the camera is, in world space.
        target: where it looks to from there.
        fov: vertical, degrees; None for that of the view.
        cameras: in place of all of these; the first frame takes the lowest number.
    """

    view: str | None = None
    eye: Point | None = None
    target: Point | None = None
    fov: float | None = None
    cameras: Cameras | None = None

    @staticmethod
    def of(view: str | None, eye: str | None, target: str | None, fov: float | None, camera: Path | None) -> Standpoint:
        """Of options.

        Raises:
            ValueError: they are not points, or the file is no file of cameras.
            FileNotFoundError: there is no such file.
        """
        cameras = None
        if camera is not None:
            from gbufrt.files.gbuffers.cameras import load_cameras

            cameras = load_cameras(camera)
        at, toward = parse_point("--eye", eye), parse_point("--target", target)
        return Standpoint(view=view, eye=at, target=toward, fov=fov, cameras=cameras)

    @property
    def frames(self) -> int:
        """How many frames there are unless another number is asked for."""
        return 1 if self.cameras is None else max(len(self.cameras.numbers), 1)

    def check(self, frames: int) -> None:
        """Raise ValueError where options exclude each other or make no sense, or a file lacks some of the frames."""
        if self.cameras is not None:
            for name in ("view", "eye", "target", "fov"):
                if getattr(self, name) is not None:
                    raise ValueError(f"--camera says where the camera is and what it sees; leave --{name} out")
            for index in range(frames if self.cameras.numbers else 0):
                if turns := self._turn(self.cameras, index):
                    number = self._number(self.cameras, index)
                    warnings.warn(f"{self.cameras.path}, frame {number}: {turns}: taken for a cut", stacklevel=2)
        if (self.eye is None) != (self.target is None) or (self.eye is not None and self.view is not None):
            raise ValueError("--eye and --target go together, in place of --view; give both of them or a view")
        if self.eye is not None and self.eye == self.target:
            raise ValueError(f"--target must not be where --eye is, got {self.target} for both")
        if self.fov is not None and not 0.1 <= self.fov <= 170:
            raise ValueError(f"--fov must be 0.1 to 170 degrees, got {self.fov:g}")

    def check_in(self, scene: Scene | Stream, world: str) -> None:
        """Raise ValueError unless the scene has the view; warn where the first frame is seen from inside a block."""
        if self.cameras is None and self.eye is None:
            if not scene.views:
                raise ValueError(f"world {world!r} has no views to look from; give --eye and --target, or --camera")
            if self.view is not None and self.view not in scene.views:
                raise ValueError(unknown("view", self.view, f"world {world!r}", scene.views))
        else:
            tell_inside(scene, self.eye_at(scene, 0, 0.0), "--eye" if self.cameras is None else "--camera")

    def camera(
        self,
        scene: Scene | Stream,
        index: int,
        time: float,
        *,
        size: tuple[int, int],
        of: tuple[int, int] | None = None,
    ) -> Camera:
        """The camera of a frame.

        Args:
            scene: which has views.
            index: number of the frame, from 0; of a file's cameras the one before the first is the first itself.
            time: seconds.
            size: ``(H, W)``.
            of: the picture's size, where ``size`` is that of what is traced for it.
        """
        if self.cameras is None:
            return self._view(scene).camera(time, size=size)
        number = self._number(self.cameras, max(index, 0))
        return self.cameras.at(number, of or size).resized(size)

    def eye_at(self, scene: Scene | Stream, index: int, time: float) -> Sequence[float]:
        """Where the camera of a frame is, in world space; see `camera`."""
        if self.cameras is None:
            return self._view(scene).eye(time)
        return self.camera(scene, index, time, size=(2, 2)).position[0].tolist()

    def cuts_at(self, index: int) -> bool:
        """Whether a frame begins another shot: the file says so, or the camera turns too far."""
        if self.cameras is None or not self.cameras.numbers or index == 0:
            return False
        return self.cameras.cuts_at(self._number(self.cameras, index)) or bool(self._turn(self.cameras, index))

    def notes(self) -> dict[str, Any]:
        """What a frame depends on, as JSON values."""
        places = {name: None if (at := getattr(self, name)) is None else list(at) for name in ("eye", "target")}
        known = {"fov": self.fov, **places, "cameras": None if self.cameras is None else _digest(self.cameras)}
        return {"view": self.view, **{name: value for name, value in known.items() if value is not None}}

    def _view(self, scene: Scene | Stream) -> View:
        from tracer.scene.view import View

        if self.eye is not None and self.target is not None:
            eye, target = self.eye, self.target
            return View(eye=lambda _: eye, target=lambda _: target, fov_y=View.fov_y if self.fov is None else self.fov)
        view = scene.views[self.view or next(iter(scene.views))]
        return view if self.fov is None else replace(view, fov_y=self.fov)

    def _turn(self, cameras: Cameras, index: int) -> str:
        """See `turn_between`; empty where the file says that there is a cut."""
        from gbufrt.files.gbuffers.cuts import turn_between

        number = self._number(cameras, index)
        camera = cameras.at(number, (2, 2))
        if index == 0 or cameras.cuts_at(number):
            return ""
        return turn_between(cameras.at(self._number(cameras, index - 1), (2, 2)), camera)

    @staticmethod
    def _number(cameras: Cameras, index: int) -> int:
        return cameras.numbers[0] + index if cameras.numbers else index  # any, where one camera holds for all


def _digest(cameras: Cameras) -> str:
    """A text that is another one for other cameras."""
    tables = {str(number): dict(table) for number, table in cameras.tables.items()}
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()[:16]
