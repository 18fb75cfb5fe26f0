"""Camera: where pixels look. The only file that knows where a pixel's centre lies.

View space is OpenCV's (x right, y down, z forward), world space is right-handed with y up. ``px`` is a position in the
picture in pixels, x right and y down, with the centre of the top left pixel at (0.5, 0.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import torch
from kornia.geometry.depth import depth_to_normals
from torch import Tensor

from gbufrt.compute.resident import resident, waits
from gbufrt.directions import length
from gbufrt.matrices import check_matrices, check_pixels, check_size
from gbufrt.tree import map_tensors

PARALLEL = 1e-9  # sine of the smallest angle between the view direction and up


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
        if self.intrinsics.ndim != 3 or self.intrinsics.shape[1:] != (3, 3):
            raise ValueError(f"intrinsics must be (B,3,3) in pixels, got {_shape(self.intrinsics)}")
        batch = self.intrinsics.shape[0]
        if self.world_from_view.shape != (batch, 4, 4):
            raise ValueError(f"world_from_view must be ({batch},4,4), got {_shape(self.world_from_view)}")
        check_size(self.size)
        if not 0 < self.near < self.far < math.inf:
            raise ValueError(f"near and far must be finite with 0 < near < far, got near={self.near}, far={self.far}")
        if self.jitter is not None and self.jitter.shape != (batch, 2):
            raise ValueError(f"jitter must be ({batch},2) in pixels, got {_shape(self.jitter)}")
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
        k = torch.as_tensor(intrinsics)
        pose = torch.as_tensor(world_from_view)
        k, pose = (k[None] if k.ndim == 2 else k), (pose[None] if pose.ndim == 2 else pose)
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
            ValueError: the field of view is not in (0, 180), or eye, target and up lie on one line.
        """
        check_size(size)
        if not 0.0 < fov_y < 180.0:
            raise ValueError(f"fov_y must lie between 0 and 180 degrees, got {fov_y}")
        tensors = [value for value in (eye, target, up) if isinstance(value, Tensor)]
        device = tensors[0].device if tensors else None
        dtype = torch.float64 if any(value.dtype == torch.float64 for value in tensors) else torch.float32
        eye, target, up = torch.broadcast_tensors(*(_vectors(value, device) for value in (eye, target, up)))
        forward = target - eye
        right = torch.linalg.cross(forward, up)
        parallel = right.norm(dim=-1) < PARALLEL * forward.norm(dim=-1).clamp_min(PARALLEL)
        if parallel.device.type != "meta" and bool(parallel.any()):
            raise ValueError("eye, target and up must not lie on one line; choose another up or target")
        forward = forward / forward.norm(dim=-1, keepdim=True)
        right = right / right.norm(dim=-1, keepdim=True)
        axes = torch.stack([right, torch.linalg.cross(forward, right), forward, eye], dim=-1)
        last = torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=eye.dtype, device=device)
        pose = torch.cat([axes, last.expand(eye.shape[0], 1, 4)], dim=1)
        height, width = size
        spread = orthographic_height if orthographic_height is not None else 2 * math.tan(math.radians(fov_y) / 2)
        focal = height / spread
        k = torch.tensor([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]], dtype=dtype)
        return Camera.from_intrinsics(
            k.to(device or "cpu"),
            pose.to(dtype),
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
        rotation = self.world_from_view[:, :3, :3].transpose(1, 2)
        inverse = torch.zeros_like(self.world_from_view)
        inverse[:, :3, :3] = rotation
        inverse[:, :3, 3] = -(rotation @ self.world_from_view[:, :3, 3:])[..., 0]
        inverse[:, 3, 3] = 1.0
        return inverse

    def to(self, *args: Any, **kwargs: Any) -> Camera:
        """The camera on another device or in another type; arguments as `torch.Tensor.to`."""
        return map_tensors(lambda t: t.to(*args, **kwargs), self)

    def with_jitter(self, jitter: Tensor | tuple[float, float] | None) -> Camera:
        """The same cameras, sampled at ``jitter`` pixels from the pixel centres (``(2,)``, ``(B, 2)`` or None)."""
        if jitter is None:
            return replace(self, jitter=None)
        offset = torch.as_tensor(jitter, dtype=self.intrinsics.dtype, device=self.device)
        return replace(self, jitter=offset.expand(self.batch, 2))

    def resized(self, size: tuple[int, int]) -> Camera:
        """The same views with another number of pixels ``(H, W)``, without jitter."""
        check_size(size)
        scale = resident((size[1] / self.width, size[0] / self.height, 1.0), self.intrinsics)
        return replace(self, intrinsics=self.intrinsics * scale[:, None], size=size, jitter=None)

    def pixel_centers(self, *, jittered: bool = True, dtype: torch.dtype | None = None) -> Tensor:
        """``(B, 2, H, W)``: ``px`` at which each pixel is sampled, or its centre when ``jittered`` is False."""
        dtype = dtype or self.intrinsics.dtype
        y = torch.arange(self.height, dtype=dtype, device=self.device) + 0.5
        x = torch.arange(self.width, dtype=dtype, device=self.device) + 0.5
        grid = torch.stack(torch.meshgrid(y, x, indexing="ij")[::-1])[None].expand(self.batch, -1, -1, -1)
        if jittered and self.jitter is not None:
            grid = grid + self.jitter.to(dtype)[:, :, None, None]
        return grid

    def unproject(self, depth: Tensor, px: Tensor | None = None) -> Tensor:
        """View-space points at planar ``depth``.

        Args:
            depth: ``(B, 1, H, W)`` planar view z, world units.
            px: ``(B, 2, H, W)`` picture positions; by default where each pixel was sampled.

        Returns:
            ``(B, 3, H, W)`` view space, world units.
        """
        px = self.pixel_centers(dtype=depth.dtype) if px is None else px
        k = self.intrinsics.to(depth.dtype)[..., None, None]
        x = (px[:, 0:1] - k[:, 0, 2, None]) / k[:, 0, 0, None]
        y = (px[:, 1:2] - k[:, 1, 2, None]) / k[:, 1, 1, None]
        if self.orthographic:
            x, y = x.expand_as(depth), y.expand_as(depth)
        else:
            x, y = x * depth, y * depth
        return torch.cat([x, y, depth], dim=1)

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
        ones = (1,) * (points_view.ndim - 2)
        k = self.intrinsics.to(points_view.dtype)
        z = 1.0 if self.orthographic else points_view[:, 2].clamp_min(1e-9)
        x = points_view[:, 0] / z * k[:, 0, 0].reshape(-1, *ones) + k[:, 0, 2].reshape(-1, *ones)
        y = points_view[:, 1] / z * k[:, 1, 1].reshape(-1, *ones) + k[:, 1, 2].reshape(-1, *ones)
        px = torch.stack([x, y], dim=1)
        if jittered and self.jitter is not None:
            px = px - self.jitter.to(px.dtype).reshape(-1, 2, *ones)
        return px

    def to_world(self, points_view: Tensor) -> Tensor:
        """View-space points ``(B, 3, ...)`` in world space."""
        return _transform(self.world_from_view, points_view)

    def to_view(self, points_world: Tensor) -> Tensor:
        """World-space points ``(B, 3, ...)`` in view space."""
        return _transform(self.view_from_world, points_world)

    def rotate_to_world(self, vectors_view: Tensor) -> Tensor:
        """View-space directions ``(B, 3, ...)`` in world space."""
        return _rotate(self.world_from_view, vectors_view)

    def rotate_to_view(self, vectors_world: Tensor) -> Tensor:
        """World-space directions ``(B, 3, ...)`` in view space."""
        return _rotate(self.rotation_to_view, vectors_world)

    def to_eye(self, points_view: Tensor) -> Tensor:
        """Unit view-space directions from points ``(B, 3, H, W)`` toward the eye (parallel when orthographic)."""
        if self.orthographic:
            return torch.zeros_like(points_view) - points_view.new_tensor([0.0, 0.0, 1.0])[None, :, None, None]
        return -points_view / length(points_view).clamp_min(1e-12)

    def along_axis(self, dtype: torch.dtype) -> Tensor:
        """``(B, 1, H, W)``: planar depth of a world unit along each pixel's ray, away from the eye."""
        if self.orthographic:
            return torch.ones(self.batch, 1, *self.size, dtype=dtype, device=self.device)
        lens = self.lens.to(dtype)[..., None, None, None]
        slopes = [  # of a row and of a column: planes of both, as `unproject` makes, would take six times the memory
            (torch.arange(n, dtype=dtype, device=self.device) + 0.5 + lens[:, 4 + i] - lens[:, 2 + i]) / lens[:, i]
            for i, n in enumerate((self.width, self.height))
        ]
        return 1 / (slopes[0] * slopes[0] + (slopes[1] * slopes[1]).mT + 1).sqrt()

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
            previous minus current view z (zero for the sky).
        """
        px = self.pixel_centers(dtype=depth.dtype)
        points = self.unproject(depth, px)
        before = previous.to_view(self.to_world(points))
        turned = previous.rotate_to_view(self.rotate_to_world(points))
        if self.orthographic:  # every sky ray is parallel: the sky has no parallax and its rotation cannot be drawn
            turned = points
        before = torch.where(hit, before, turned)
        motion = previous.project(before) - px
        return motion, torch.where(hit, before[:, 2:] - depth, torch.zeros_like(depth))

    def normals_from_depth(self, depth: Tensor) -> Tensor:
        """World-space unit normals facing the camera, estimated from planar depth ``(B, 1, H, W)``.

        Raises:
            ValueError: depth has another shape, or the picture is smaller than 2x2.
        """
        if depth.ndim != 4 or depth.shape[1] != 1:
            raise ValueError(f"depth must be (B,1,H,W), planar view z, got {_shape(depth)}")
        if min(depth.shape[-2:]) < 2:
            raise ValueError(f"normals from depth need a picture of at least 2x2, got {tuple(depth.shape[-2:])}")
        points = self.unproject(depth)
        if self.orthographic:
            dx, dy = torch.gradient(points, dim=(3, 2))
            away = torch.linalg.cross(dx, dy, dim=1)
            away = away / length(away)
        else:  # kornia counts pixel centres from integers, and its normals face away from the camera
            k = self.intrinsics.to(depth.dtype).clone()
            k[:, :2, 2] = k[:, :2, 2] - 0.5 - (0.0 if self.jitter is None else self.jitter.to(depth.dtype))
            away = depth_to_normals(depth, k)
        facing = torch.where((away * self.to_eye(points)).sum(1, keepdim=True) < 0, -away, away)
        return self.rotate_to_world(facing)


def _shape(tensor: Tensor) -> str:
    return "(" + ",".join(str(n) for n in tensor.shape) + ")"


def _vectors(value: Any, device: torch.device | None) -> Tensor:
    tensor = torch.as_tensor(value, dtype=torch.float64, device=device)
    tensor = tensor[None] if tensor.ndim == 1 else tensor
    if tensor.ndim != 2 or tensor.shape[1] != 3:
        raise ValueError(f"a position or direction must be (3,) or (B,3), got {_shape(tensor)}")
    return tensor


def _rotate(matrix: Tensor, vectors: Tensor) -> Tensor:
    rotation = matrix[:, :3, :3].to(vectors.dtype)
    return torch.einsum("bij,bj...->bi...", rotation, vectors)


def _transform(matrix: Tensor, points: Tensor) -> Tensor:
    offset = matrix[:, :3, 3].to(points.dtype).reshape(-1, 3, *(1,) * (points.ndim - 2))
    return _rotate(matrix, points) + offset
