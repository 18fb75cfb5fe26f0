"""Scene: a world, what moves over it, and what lights it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import torch
from torch import Tensor

from gbufrt.compute.resident import resident
from gbufrt.numeric import (
    check_between,
    check_bits,
    check_destination,
    check_each,
    check_function,
    check_kind,
    check_numbers,
    check_three,
)
from gbufrt.tree import map_tensors
from tracer.scene.fog import Fog
from tracer.scene.grids import Grids, join
from tracer.scene.material import MaterialTable
from tracer.scene.poses import checked, posed
from tracer.scene.times import moments
from tracer.scene.view import View, Views
from tracer.scene.weather import Rain, Waves
from tracer.scene.world import World

Pose = Callable[[float], Tensor]
"""See `Instance`."""

MASK_PRIMARY, MASK_SHADOW, MASK_SECONDARY = 1, 2, 4
MASK_ALL = MASK_PRIMARY | MASK_SHADOW | MASK_SECONDARY
WIDEST = 89.0  # degrees: a sun of half the sky is a sky


@dataclass(frozen=True, eq=False, kw_only=True)
class Instance:
    """A small voxel model that moves rigidly over the world.

    Args:
        model: its voxels, in its own coordinates and with its own materials.
        pose: where it is: a function of the time in seconds, a float, that returns a ``(4, 4)`` tensor of floats on the
            CPU, the rigid transform (rotation and position, world units; the last row is 0, 0, 0, 1) from the model's
            voxel coordinates, times ``scale``, to world space. It may be asked for any time, in any order.
        scale: world units a voxel of the model.
        mask: which rays can hit it, a sum of MASK_PRIMARY (camera), MASK_SHADOW and MASK_SECONDARY (bounces).
        name: for people.
    """

    model: World
    pose: Pose
    scale: float = 1.0
    mask: int = MASK_ALL
    name: str = ""

    def __post_init__(self) -> None:
        check_kind(World, "model", self.model)
        check_function("pose", self.pose, "of the time in seconds that returns a (4,4) tensor")
        check_numbers(scale=self.scale)
        check_each(0, above=True, unit="world units a voxel", scale=self.scale)
        check_bits(mask=self.mask)


@dataclass(frozen=True, eq=False, kw_only=True)
class Sun:
    """A disc in the sky.

    Args:
        direction: toward the sun, world space; any length.
        irradiance: irradiance on a surface that faces it, linear RGB.
        angular_radius: degrees; 0.27 is Earth's, larger is softer.
    """

    direction: tuple[float, float, float] = (0.45, 0.65, 0.35)
    irradiance: tuple[float, float, float] = (3.2, 2.9, 2.4)
    angular_radius: float = 0.6

    def __post_init__(self) -> None:
        for name in ("direction", "irradiance"):
            check_three(name, getattr(self, name), "the sun")
        if not 0 < math.hypot(*self.direction) < math.inf:
            raise ValueError(f"direction of the sun must have a finite length above 0, got {self.direction}")
        if not all(0 <= light < math.inf for light in self.irradiance):
            raise ValueError(f"irradiance of the sun must be finite and not negative, got {self.irradiance}")
        check_between(0, WIDEST, angular_radius=self.angular_radius)


class Plain(NamedTuple):
    """The land below the horizon, where the voxels end."""

    albedo: tuple[float, float, float]
    """Linear RGB, of what is no water."""
    water: float = 0.0
    """The share that is water."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sky:
    """Radiance of the sky without the sun's disc, linear RGB.

    Args:
        zenith: straight above; between it and the horizon it goes by elevation, with a glow round the sun.
        horizon: at eye level.
        ground: below.
        plain: what `tracer.at_hour` lights there; grey land by default.
        picture: in place of all these, a lat-long picture ``(1, 3, h, w)``, oriented as `gbufrt.environment` says.
        stars: ``(3, 3)`` rotation from world space to the sphere of the fixed stars; the camera sees them then.
        dayless: it knows no hours and no rain, as those of the Nether and the End.
    """

    zenith: tuple[float, float, float] = (0.25, 0.45, 0.95)
    horizon: tuple[float, float, float] = (0.85, 0.95, 1.05)
    ground: tuple[float, float, float] = (0.25, 0.22, 0.18)
    plain: Plain | None = None
    picture: Tensor | None = None
    stars: Tensor | None = None
    dayless: bool = False

    def __post_init__(self) -> None:
        for name in ("zenith", "horizon", "ground"):
            check_three(name, getattr(self, name), "the sky")
        for name, kind in (("picture", Tensor), ("stars", Tensor), ("plain", Plain)):
            if (given := getattr(self, name)) is not None:
                check_kind(kind, name, given)
        for name in ("zenith", "horizon", "ground"):
            if not all(0 <= light < math.inf for light in getattr(self, name)):
                raise ValueError(f"{name} of the sky must be finite and not negative, got {getattr(self, name)}")
        if self.plain is not None:
            check_three("albedo", self.plain.albedo, "the plain")
            check_between(0, 1, water=self.plain.water)
        if self.stars is not None and self.stars.shape != (3, 3):
            raise ValueError(f"stars must be (3,3), a rotation, got {tuple(self.stars.shape)}")
        if self.picture is not None and (self.picture.ndim != 4 or self.picture.shape[:2] != (1, 3)):
            raise ValueError(f"picture must be (1,3,h,w), linear radiance, got {tuple(self.picture.shape)}")


@dataclass(frozen=True, eq=False, kw_only=True)
class Haze:
    """Air that takes what is far off into the colour of the sky behind it, in G-buffers and frames, not in truth.

    Args:
        begin: distance along the ground from which on it is seen, world units.
        end: distance from which on nothing else is.
    """

    begin: float
    end: float

    def __post_init__(self) -> None:
        check_between(0, math.inf, begin=self.begin, end=self.end)
        if not self.begin < self.end:
            raise ValueError(f"begin of haze must be less than its end, got {self.begin:g} and {self.end:g}")

    def and_also(self, other: Haze | None) -> Haze:
        """The haze that hides what either of two hides."""
        return self if other is None else Haze(begin=min(self.begin, other.begin), end=min(self.end, other.end))


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """Everything that `tracer.render` needs except the camera."""

    world: World
    instances: tuple[Instance, ...] = ()
    sun: Sun | None = field(default_factory=Sun)
    sky: Sky = field(default_factory=Sky)
    views: Mapping[str, View] = field(default_factory=dict)
    """The first one is the default."""
    haze: Haze | None = None
    rain: Rain | None = None
    waves: Waves | None = None
    fog: Fog | None = None

    def __post_init__(self) -> None:
        check_kind(World, "world", self.world, "; tracer.load(name) gives a scene")
        check_kind(Sky, "sky", self.sky)
        for name, kind in (("sun", Sun), ("haze", Haze), ("rain", Rain), ("waves", Waves), ("fog", Fog)):
            if (given := getattr(self, name)) is not None:
                check_kind(kind, name, given)
        if not isinstance(self.instances, Sequence) or isinstance(self.instances, str):
            raise TypeError(f"instances must be a tuple of tracer.Instance, got {type(self.instances).__name__}")
        for instance in self.instances:
            check_kind(Instance, "instances", instance)
        if not isinstance(self.views, Mapping) or not all(isinstance(v, View) for v in self.views.values()):
            raise TypeError(f"views must be a mapping of names to tracer.View, got {type(self.views).__name__}")
        if not isinstance(self.views, Views):
            object.__setattr__(self, "views", Views(self.views))

    def around(self, eye: Sequence[float]) -> Scene:
        """What a camera there can see: this scene. A `tracer.Stream` has another one for other places."""
        del eye
        return self

    def poses(self, times: Sequence[float]) -> Tensor:
        """``(B, I, 4, 4)``: world from model of every instance at every time, in seconds."""
        times = moments(times, "times")
        if not self.instances:
            return torch.zeros(len(times), 0, 4, 4)
        return checked(torch.stack([torch.stack([posed(i.pose(t), i.name) for i in self.instances]) for t in times]))

    @cached_property
    def grids(self) -> Grids:
        """The voxels of world and instances in the form that rays traverse."""
        return join(
            [self.world, *(i.model for i in self.instances)],
            [MASK_ALL, *(i.mask for i in self.instances)],
            ["", *(i.name for i in self.instances)],
        )

    @property
    def materials(self) -> MaterialTable:
        """Materials of world and instances in one table; the world's voxel ids keep their rows."""
        return self.grids.materials

    @property
    def device(self) -> torch.device:
        """The device of the voxels."""
        return self.world.device

    @property
    def empty(self) -> bool:
        """Whether there is no voxel at all."""
        return self.world.empty and all(i.model.empty for i in self.instances)

    def world_from_model(self, poses: Tensor) -> Tensor:
        """``poses`` ``(..., I, 4, 4)`` with the scale of each instance in them."""
        scales = resident(tuple((i.scale, i.scale, i.scale, 1.0) for i in self.instances), poses).view(-1, 1, 4)
        return poses * scales

    def to(self, *args: Any, **kwargs: Any) -> Scene:
        """The scene on another device; arguments as `torch.Tensor.to`. What instances share stays shared."""
        check_destination(*args, **kwargs)
        moved: dict[Tensor, Tensor] = {}

        def move(tensor: Tensor) -> Tensor:
            if tensor not in moved:
                moved[tensor] = tensor.to(*args, **kwargs)
            return moved[tensor]

        return map_tensors(move, self)
