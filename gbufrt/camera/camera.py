"""Camera: where pixels look.

View space is OpenCV's (x right, y down, z forward), world space is right-handed with y up. ``px`` is a position in the
picture in pixels, x right and y down, with the centre of the top left pixel at (0.5, 0.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from gbufrt.camera.matrices import check_matrices, check_pixels, matrix_of, told_shape
from gbufrt.camera.normals import check_depth_map, facing_normals
from gbufrt.camera.placement import centred_lens, looking_at, spread_of
from gbufrt.camera.transforms import (
    depth_per_unit,
    inverted,
    off_picture,
    projected,
    rotate,
    sampled_at,
    sampled_rows,
    transform,
    unit_to_eye,
    unprojected,
)
from gbufrt.compute.resident import resident, waits
from gbufrt.directions import length
from gbufrt.numeric import check_destination, check_each, check_numbers, check_size
from gbufrt.tree import map_tensors


@dataclass(frozen=True, eq=False, kw_only=True)
class Camera:
    """A batch of B pinhole or orthographic cameras that share one picture size.

    Args:
        intrinsics: ``(B, 3, 3)``, pixels; pixel centres at +0.5. An orthographic camera reads the focal lengths as
            pixels per world unit.
        world_from_view: ``(B, 4, 4)`` rigid transform from view space to world space: a rotation without scale, skew
            or mirroring, and a position.
        size: ``(H, W)``.
        near: planar depth of the near plane, world units; nothing nearer is visible.
        far: planar depth stored where nothing was hit, world units.
        orthographic: parallel rays along view z.
        jitter: ``(B, 2)`` pixels: pixel i is sampled at i + 0.5 + jitter. Absent means none.

    Raises:
        ValueError: a shape, size, range or matrix breaks a rule above. Matrices on a GPU are checked by
            `gbufrt.GBuffer.validate` alone, because the host would wait for them whenever a camera is made.
    """

    intrinsics: Tensor
    world_from_view: Tensor
    size: tuple[int, int]
    near: float = 0.05
    far: float = 1000.0
    orthographic: bool = False
    jitter: Tensor | None = None

    def __post_init__(self) -> None:
        for name in ("intrinsics", "world_from_view", "jitter"):
            if not isinstance(value := getattr(self, name), Tensor) and (value is not None or name != "jitter"):
                wanted = f"{name} must be a torch.Tensor, got {type(value).__name__}"
                raise TypeError(f"{wanted}; Camera.from_intrinsics takes arrays and lists")
        check_numbers(near=self.near, far=self.far)
        if self.intrinsics.ndim != 3 or self.intrinsics.shape[1:] != (3, 3):
            raise ValueError(f"intrinsics must be (B,3,3) in pixels, got {told_shape(self.intrinsics)}")
        batch = self.intrinsics.shape[0]
        if self.world_from_view.shape != (batch, 4, 4):
            raise ValueError(f"world_from_view must be ({batch},4,4), got {told_shape(self.world_from_view)}")
        check_size(self.size)
        if not 0 < self.near < self.far < math.inf:
            raise ValueError(f"near and far must be finite with 0 < near < far, got near={self.near}, far={self.far}")
        if self.jitter is not None and self.jitter.shape != (batch, 2):
            raise ValueError(f"jitter must be ({batch},2) in pixels, got {told_shape(self.jitter)}")
        if not (waits(self.intrinsics) or waits(self.world_from_view)):
            check_matrices(self.intrinsics, self.world_from_view, self.jitter)

    def __repr__(self) -> str:
        """The first camera of the batch in one line."""
        (x, y, z), (dx, dy, dz) = self.position[0].tolist(), self.forward[0].tolist()
        fx, fy = self.intrinsics[0, 0, 0].item(), self.intrinsics[0, 1, 1].item()
        if self.orthographic:
            field = f"orthographic, {self.width / fx:.4g} x {self.height / fy:.4g} units"
        else:
            across, down = (math.degrees(2 * math.atan(n / 2 / f)) for n, f in ((self.width, fx), (self.height, fy)))
            field = f"{across:.1f} x {down:.1f} degrees"
        more = "" if self.batch == 1 else f", first of {self.batch}"
        where = f"at ({x:.4g}, {y:.4g}, {z:.4g}), forward ({dx:.3f}, {dy:.3f}, {dz:.3f})"
        return f"Camera({self.width}x{self.height}, {field}, {where}, near {self.near:g}, far {self.far:g}{more})"

    @staticmethod
    def from_intrinsics(
        intrinsics: Tensor,
        world_from_view: Tensor,
        *,
        size: tuple[int, int],
        near: float = 0.05,
        far: float = 1000.0,
        orthographic: bool = False,
        jitter: Tensor | None = None,
    ) -> Camera:
        """A camera from matrices with or without a batch dimension. See `Camera` for units and errors."""
        check_numbers(near=near, far=far)
        k, pose = matrix_of("intrinsics", intrinsics, 3), matrix_of("world_from_view", world_from_view, 4)
        batch = max(k.shape[0], pose.shape[0])
        check_size(size)
        if not orthographic and not waits(k):
            check_pixels(k, size)
        dtype = torch.float64 if torch.float64 in (k.dtype, pose.dtype) else torch.float32
        return Camera(
            intrinsics=k.to(dtype).expand(batch, *k.shape[1:]),
            world_from_view=pose.to(dtype).expand(batch, *pose.shape[1:]),
            size=(int(size[0]), int(size[1])),
            near=float(near),
            far=float(far),
            orthographic=orthographic,
            jitter=jitter,
        )

    @staticmethod
    def look_at(
        eye: Any,
        target: Any,
        *,
        size: tuple[int, int],
        fov_y: float = 60.0,
        up: Any = (0.0, 1.0, 0.0),
        near: float = 0.05,
        far: float = 1000.0,
        orthographic_height: float | None = None,
    ) -> Camera:
        """A camera at ``eye`` that looks at ``target``.

        Its matrices lie on the device of the first tensor among eye, target and up, and are float64 where one of them
        is a float64 tensor.

        Args:
            eye: ``(3,)`` or ``(B, 3)``, world.
            target: as ``eye``.
            size: ``(H, W)``.
            fov_y: vertical field of view in degrees.
            up: world direction that points up in the picture.
            near: see `Camera`.
            far: see `Camera`.
            orthographic_height: world units that the picture's height spans; makes the camera orthographic.

        Raises:
            TypeError: a place or direction is not three numbers.
            ValueError: the field of view is not in (0, 180), eye is target, or both and up lie on one line.
        """
        check_size(size)
        check_numbers(fov_y=fov_y)
        if orthographic_height is not None:
            check_each(0, above=True, unit="world units", orthographic_height=orthographic_height)
        pose = looking_at(eye, target, up)
        spread = spread_of(fov_y) if orthographic_height is None else orthographic_height
        return Camera.from_intrinsics(
            centred_lens(size, spread, pose),
            pose,
            size=size,
            near=near,
            far=far,
            orthographic=orthographic_height is not None,
        )

    @property
    def batch(self) -> int:
        """How many cameras."""
        return self.intrinsics.shape[0]

    @property
    def height(self) -> int:
        """Rows of the picture."""
        return self.size[0]

    @property
    def width(self) -> int:
        """Columns of the picture."""
        return self.size[1]

    @property
    def device(self) -> torch.device:
        """Where the matrices live."""
        return self.intrinsics.device

    @property
    def position(self) -> Tensor:
        """``(B, 3)`` world position of the view's origin."""
        return self.world_from_view[:, :3, 3]

    @property
    def forward(self) -> Tensor:
        """``(B, 3)`` world direction of view z."""
        return self.world_from_view[:, :3, 2]

    @property
    def lens(self) -> Tensor:
        """``(B, 6)``: focal lengths, principal point and jitter, each in x and y, pixels."""
        k = self.intrinsics
        jitter = torch.zeros_like(k[:, 0, :2]) if self.jitter is None else self.jitter.to(k)
        return torch.cat([k.diagonal(dim1=1, dim2=2)[:, :2], k[:, :2, 2], jitter], dim=1)

    @property
    def rotation_to_view(self) -> Tensor:
        """``(B, 3, 3)``: the rotation of `view_from_world`, which is much cheaper to have alone."""
        return self.world_from_view[:, :3, :3].mT.contiguous()

    @property
    def view_from_world(self) -> Tensor:
        """``(B, 4, 4)`` inverse of ``world_from_view``, which is rigid."""
        return inverted(self.world_from_view)

    def to(self, *args: Any, **kwargs: Any) -> Camera:
        """The camera on another device or in another type; arguments as `torch.Tensor.to`."""
        check_destination(*args, **kwargs)
        return map_tensors(lambda t: t.to(*args, **kwargs), self)

    def with_jitter(self, jitter: Tensor | tuple[float, float] | None) -> Camera:
        """The same cameras, sampled at ``jitter`` pixels from the pixel centres (``(2,)``, ``(B, 2)`` or None)."""
        if jitter is None:
            return replace(self, jitter=None)
        try:
            offset = torch.as_tensor(jitter, dtype=self.intrinsics.dtype, device=self.device)
        except (TypeError, ValueError, RuntimeError):
            raise TypeError(f"jitter must be two numbers or a tensor, in pixels, got {jitter!r}") from None
        if offset.shape not in ((2,), (1, 2), (self.batch, 2)):
            raise ValueError(f"jitter must be (2,) or ({self.batch},2) in pixels, got {told_shape(offset)}")
        return replace(self, jitter=offset.expand(self.batch, 2))

    def resized(self, size: tuple[int, int]) -> Camera:
        """The same views with another number of pixels ``(H, W)``, without jitter."""
        check_size(size)
        scale = resident((size[1] / self.width, size[0] / self.height, 1.0), self.intrinsics)
        return replace(self, intrinsics=self.intrinsics * scale[:, None], size=size, jitter=None)

    def pixel_centers(self, *, jittered: bool = True, dtype: torch.dtype | None = None) -> Tensor:
        """``(B, 2, H, W)``: ``px`` at which each pixel is sampled, or its centre when ``jittered`` is False."""
        like = torch.empty((), dtype=dtype or self.intrinsics.dtype, device=self.device)
        return sampled_at(self.size, self.jitter if jittered else None, like).expand(self.batch, -1, -1, -1)

    def unproject(self, depth: Tensor, px: Tensor | None = None) -> Tensor:
        """View-space points at planar ``depth``.

        Args:
            depth: ``(B, 1, H, W)`` planar view z, world units.
            px: ``(B, 2, H, W)`` picture positions; by default where each pixel was sampled.

        Returns:
            ``(B, 3, H, W)`` view space, world units.
        """
        if px is None:
            check_depth_map(depth, self.size)
        at = sampled_rows(self.size, self.jitter, depth) if px is None else (px[:, 0:1], px[:, 1:2])
        return unprojected(depth, at, self.intrinsics, orthographic=self.orthographic)

    def project(self, points_view: Tensor, *, jittered: bool = False) -> Tensor:
        """Where view-space points appear in the picture; the inverse of `unproject`.

        Args:
            points_view: ``(B, 3, ...)`` view space. Depths at or behind the eye are clamped to a tiny positive
                number: test z yourself.
            jittered: the position in the picture as sampled with this camera's jitter, where `gbufrt.sampling.sample`
                finds the point; otherwise the position without jitter.

        Returns:
            ``(B, 2, ...)`` px.
        """
        px = projected(points_view, self.intrinsics, orthographic=self.orthographic)
        if jittered and self.jitter is not None:
            px = px - self.jitter.to(px.dtype).reshape(-1, 2, *(1,) * (points_view.ndim - 2))
        return px

    def to_world(self, points_view: Tensor) -> Tensor:
        """View-space points ``(B, 3, ...)`` in world space."""
        return transform(self.world_from_view, points_view)

    def to_view(self, points_world: Tensor) -> Tensor:
        """World-space points ``(B, 3, ...)`` in view space."""
        return transform(self.view_from_world, points_world)

    def rotate_to_world(self, vectors_view: Tensor) -> Tensor:
        """View-space directions ``(B, 3, ...)`` in world space."""
        return rotate(self.world_from_view, vectors_view)

    def rotate_to_view(self, vectors_world: Tensor) -> Tensor:
        """World-space directions ``(B, 3, ...)`` in view space."""
        return rotate(self.rotation_to_view, vectors_world)

    def to_eye(self, points_view: Tensor) -> Tensor:
        """Unit view-space directions from points ``(B, 3, H, W)`` toward the eye (parallel when orthographic)."""
        return unit_to_eye(points_view, orthographic=self.orthographic)

    def along_axis(self, dtype: torch.dtype) -> Tensor:
        """``(B, 1, H, W)``: planar depth of a world unit along each pixel's ray, away from the eye."""
        if self.orthographic:
            return torch.ones(self.batch, 1, *self.size, dtype=dtype, device=self.device)
        return depth_per_unit(self.lens.to(dtype), self.size)

    def pixels_per_unit(self, depth: Tensor) -> Tensor:
        """How many pixels a world unit across the view spans at planar ``depth``; the shape of ``depth``."""
        focal = self.intrinsics[:, 1, 1].to(depth.dtype).reshape(-1, *(1,) * (depth.ndim - 1))
        return focal.expand_as(depth) if self.orthographic else focal / depth.clamp_min(1e-9)

    def rays(self) -> tuple[Tensor, Tensor]:
        """World-space origins and unit directions, both ``(B, H, W, 3)``, through each pixel's sampled position."""
        plane = self.unproject(torch.ones_like(self.pixel_centers()[:, :1]))
        if self.orthographic:
            offset = plane * plane.new_tensor([1.0, 1.0, 0.0])[None, :, None, None]
            origins = self.to_world(offset)
            directions = self.forward[:, :, None, None].expand_as(origins)
        else:
            directions = self.rotate_to_world(plane)
            directions = directions / length(directions)
            origins = self.position[:, :, None, None].expand_as(directions)
        return origins.permute(0, 2, 3, 1).contiguous(), directions.permute(0, 2, 3, 1).contiguous()

    def static_motion(self, previous: Camera, depth: Tensor, hit: Tensor) -> tuple[Tensor, Tensor]:
        """Motion of a static world while the camera moves from ``previous`` to this one.

        Args:
            previous: camera of the frame before.
            depth: ``(B, 1, H, W)`` planar view z, world units.
            hit: ``(B, 1, H, W)`` bool; where False the pixel shows the sky, which moves by rotation alone.

        Returns:
            ``motion`` ``(B, 2, H, W)``, previous minus current px, without jitter; and ``motion_z`` ``(B, 1, H, W)``,
            previous minus current view z (zero for the sky). What lay nearer to the camera before than its near plane,
            or behind it, was at no pixel: its motion leads off that picture, twice as far as the longer side.
        """
        if not isinstance(previous, Camera):
            raise TypeError(f"previous must be a gbufrt.Camera, got {type(previous).__name__}")
        check_depth_map(depth, self.size)
        px = self.pixel_centers(dtype=depth.dtype)
        points = self.unproject(depth, px)
        before = previous.to_view(self.to_world(points))
        turned = previous.rotate_to_view(self.rotate_to_world(points))
        if self.orthographic:  # every sky ray is parallel: the sky has no parallax and its rotation cannot be drawn
            turned = points
        before = torch.where(hit, before, turned)
        motion = previous.project(before) - px
        if not previous.orthographic:
            motion = off_picture(motion, before[:, 2:] < previous.near, previous.size)
        return motion, torch.where(hit, before[:, 2:] - depth, torch.zeros_like(depth))

    def normals_from_depth(self, depth: Tensor) -> Tensor:
        """World-space unit normals facing the camera, estimated from planar depth ``(B, 1, H, W)``.

        Raises:
            ValueError: depth has another shape or size, or the picture is smaller than 2x2.
        """
        check_depth_map(depth, self.size)
        if min(self.size) < 2:
            raise ValueError(f"normals from depth need a picture of at least 2x2, got {tuple(self.size)}")
        points = self.unproject(depth)
        facing = facing_normals(points, self.to_eye(points), self.lens, orthographic=self.orthographic)
        return self.rotate_to_world(facing)
