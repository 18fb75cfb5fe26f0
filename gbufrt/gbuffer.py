"""GBuffer: the surfaces that a camera shows, one value a pixel, under one set of conventions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from gbufrt.camera import Camera
from gbufrt.channels import channel, channels_of, check_one_kind, check_tensor
from gbufrt.numeric import check_destination, check_kind
from gbufrt.tree import changed, map_tensors
from gbufrt.validation.checks import validate_gbuffer


@dataclass(frozen=True, eq=False, kw_only=True)
class GBuffer:
    """Geometry and material of the first surface at each pixel.

    Every channel is ``(B, C, H, W)``; the fields below are the channel table (also `gbufrt.gbuffer.CHANNELS`). Absent
    channels are None, never zeros. Where nothing was hit, ``hit`` is False and the other channels hold the clear value
    (``depth``: the camera's ``far``).

    Raises:
        TypeError: a channel is not a tensor, or of the wrong type.
        ValueError: a channel has the wrong shape or device. `validate` checks the values.
    """

    camera: Camera
    previous_camera: Camera | None = None

    depth: Tensor = channel(1, "planar view-space z in world units", clear=float("nan"), required=True)
    hit: Tensor = channel(1, "whether a surface was hit", kind="bool", required=True)
    normal: Tensor = channel(3, "shading normal, world space, unit length, facing the camera", required=True)
    normal_geo: Tensor | None = channel(3, "geometric normal, world space, unit length, facing the camera")
    motion: Tensor | None = channel(2, "previous minus current px in pixels, without jitter")
    motion_z: Tensor | None = channel(1, "previous minus current view z in world units")
    albedo: Tensor | None = channel(3, "linear reflectance in [0, 1]")
    roughness: Tensor | None = channel(1, "perceptual roughness in [0, 1]; alpha is its square", clear=1.0)
    metallic: Tensor | None = channel(1, "metalness in [0, 1]")
    emission: Tensor | None = channel(3, "emitted linear radiance")
    opacity: Tensor | None = channel(1, "1 opaque, less where light from behind passes")
    transmittance: Tensor | None = channel(3, "fraction of the light from `behind` that arrives, linear RGB")
    material_id: Tensor | None = channel(1, "material index", kind="int")
    object_id: Tensor | None = channel(1, "0 static world or sky, else the moving instance", kind="int")
    thickness: Tensor | None = channel(1, "distance along the view ray to the back of the first solid run, world units")

    def __post_init__(self) -> None:
        self._check(CHANNELS)

    def _check(self, names: Iterable[str]) -> None:
        """Raise if one of the channels called ``names``, or the camera before, breaks its form."""
        if not isinstance(self.camera, Camera):
            raise TypeError(f"camera must be a gbufrt.Camera, got {type(self.camera).__name__}")
        for name in names:
            tensor, row = getattr(self, name), CHANNELS[name]
            if tensor is None and not row.required:
                continue
            check_tensor(name, tensor, row, batch=self.batch, size=self.camera.size, device=self.camera.device)
        check_one_kind(**{name: getattr(self, name) for name in self.present})
        previous = self.previous_camera
        if not isinstance(previous, Camera | None):
            raise TypeError(f"previous_camera must be a gbufrt.Camera or None, got {type(previous).__name__}")
        if previous is not None and (previous.batch, previous.size) != (self.batch, self.camera.size):
            raise ValueError(
                f"previous_camera must have batch {self.batch} and size {self.camera.size} like camera, "
                f"got batch {previous.batch} and size {previous.size}"
            )

    def __repr__(self) -> str:
        """Camera and names of the channels that are present, in one line."""
        return f"GBuffer({self.camera!r}, {', '.join(self.present)})"

    @property
    def batch(self) -> int:
        """B."""
        return self.camera.batch

    @property
    def present(self) -> tuple[str, ...]:
        """Names of the channels that are present."""
        return tuple(name for name in CHANNELS if getattr(self, name) is not None)

    def replace(self, **changes: Any) -> GBuffer:
        """A copy with some fields changed."""
        result = changed(self, changes)
        result._check(CHANNELS if "camera" in changes else changes.keys() & CHANNELS.keys())
        return result

    def to(self, *args: Any, **kwargs: Any) -> GBuffer:
        """All tensors on another device; arguments as `torch.Tensor.to`. A dtype applies to the float channels only."""
        return map_tensors(to_function(*args, **kwargs), self)

    def geometry(self) -> GBuffer:
        """What tells, in the next frame, where this one shows the same surface: depth, hit, normals and object ids."""
        names = ("depth", "hit", "normal", "normal_geo", "object_id")
        return GBuffer(camera=self.camera, **{name: getattr(self, name) for name in names})

    def points_view(self) -> Tensor:
        """``(B, 3, H, W)`` view-space position of each pixel's surface."""
        return self.camera.unproject(self.depth)

    def validate(self, before: GBuffer | None = None) -> None:
        """Check the values against the conventions.

        Args:
            before: of the frame before; with it the motion of what moves by itself is checked too. Under a camera that
                stands still nothing else tells its sign.

        Raises:
            ValueError: names the first channel that breaks a rule, the rule, how many pixels break it, one of them,
                and a remedy.
        """
        check_kind(GBuffer, "before", self if before is None else before)
        validate_gbuffer(self, before)


CHANNELS = channels_of(GBuffer)


def to_function(*args: Any, **kwargs: Any) -> Any:
    """``Tensor.to`` for trees: float types reach float tensors only, so that ids and masks keep theirs."""
    dtype = kwargs.get("dtype", next((a for a in args if isinstance(a, torch.dtype)), None))
    check_destination(*args, **kwargs)
    if dtype in (torch.float16, torch.bfloat16):
        kind = str(dtype).removeprefix("torch.")
        raise TypeError(f"channels are float32 or float64, got {kind}; convert single pictures, such as frame.image")

    def move(tensor: Tensor) -> Tensor:
        if dtype is None or tensor.is_floating_point() == dtype.is_floating_point:
            return tensor.to(*args, **kwargs)
        device = kwargs.get("device", next((a for a in args if not isinstance(a, (torch.dtype, bool))), None))
        return tensor if device is None else tensor.to(device)

    return move
