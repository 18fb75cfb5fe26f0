"""Which points of a world are on screen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.camera import Camera
from tracer.lens import one_of
from tracer.scene.poses import between, known_still
from tracer.scene.scene import MASK_PRIMARY, Scene
from tracer.traversal.rays import trace

SLACK = 2.0  # pixels' width by which depths may differ: surfaces show more detail than the picture resolves
EDGE_ON = 0.02  # sine below which a pixel's plane is too steep to be continued over the pixel
NEIGHBORS = ((0, 0), (0, 1), (0, -1), (1, 0), (-1, 0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """What one camera shows, as flat arrays.

    Args:
        camera: one camera.
        depth: ``(H * W,)`` planar, inf where nothing was hit.
        normal: ``(3, H * W)`` of the surfaces, view space.
        back: ``(I + 1, 3, 4)``, back-projection of points on the world and on each instance, from where they are now
            to where they are in the picture; None where that is the same.
    """

    camera: Camera
    depth: Tensor
    normal: Tensor
    back: Tensor | None = None

    @staticmethod
    def of(gbuffer: GBuffer, number: int) -> Picture:
        """Picture ``number`` of the batch."""
        camera, normal = gbuffer.camera, gbuffer.normal if gbuffer.normal_geo is None else gbuffer.normal_geo
        return Picture(
            camera=one_of(camera, number),
            depth=torch.where(gbuffer.hit, gbuffer.depth, torch.inf)[number].flatten().float(),
            normal=camera.rotate_to_view(normal)[number].flatten(1).float(),
        )

    def moved(self, then: Tensor, now: Tensor) -> Picture:
        """The same picture, of instances as they are ``then``, for points as they are ``now``: poses ``(I, 4, 4)``."""
        return replace(self, back=None if known_still(then, now) else between(now, then))

    def back_project(self, points: Tensor, normals: Tensor, instances: Tensor) -> tuple[Tensor, Tensor]:
        """Points and normals ``(N, 3)`` on ``instances`` ``(N,)``, 0 for the world, taken to the picture."""
        if self.back is None:
            return points, normals
        back = self.back[instances.long()]
        turned = (back[..., :3] @ torch.stack([points, normals], dim=-1)).unbind(dim=-1)
        return turned[0] + back[..., 3], turned[1]

    def sees(self, points: Tensor, normals: Tensor) -> Tensor:
        """Whether points on surfaces are on screen.

        They must face the camera and project into the picture. The pixel there, or one of its four neighbours, must
        have their depth to within two pixels' width, the detail that a picture cannot resolve. Either the pixel's own
        depth counts, or that of its surface's plane continued to the point.

        Args:
            points: ``(N, 3)`` world space.
            normals: ``(N, 3)`` of the surfaces there, world space.

        Returns:
            ``(N,)`` bool.
        """
        camera = self.camera
        view = camera.to_view(points.T[None])
        z = view[0, 2]
        px = camera.project(view, jittered=True)[0]
        toward = camera.forward[0].expand_as(points) if camera.orthographic else points - camera.position[0]
        faces = (toward * normals).sum(-1) < 0
        found = faces & (z > 0) & self._within(px)
        rows = found.nonzero()[:, 0]
        z, at = z[rows], view[0, :, rows].T
        slack = SLACK / camera.pixels_per_unit(z[None])[0]
        agrees = torch.zeros_like(rows, dtype=torch.bool)
        for pixel in self._pixels(px[:, rows]):
            agrees |= ((self.depth[pixel] - z).abs() < slack) | self._on_plane(pixel, at, slack)
        found[rows] = agrees
        return found

    def shows_sky(self, directions: Tensor) -> Tensor:
        """Whether the sky shows in ``directions`` ``(N, 3)``, world space: ``(N,)`` bool.

        The pixel there or one of its four neighbours must show it. An orthographic picture shows one point of the sky,
        if any, which is taken for all of it.
        """
        camera = self.camera
        if camera.orthographic:
            return self.depth.isinf().any().expand(len(directions))
        view = camera.rotate_to_view(directions.T[None])
        px = camera.project(view, jittered=True)[0]
        found = (view[0, 2] > 0) & self._within(px)
        rows = found.nonzero()[:, 0]
        found[rows] = torch.stack([self.depth[pixel].isinf() for pixel in self._pixels(px[:, rows])]).any(dim=0)
        return found

    def _within(self, px: Tensor) -> Tensor:
        height, width = self.camera.size
        return (px[0] >= 0) & (px[0] < width) & (px[1] >= 0) & (px[1] < height)

    def _pixels(self, px: Tensor) -> Iterator[Tensor]:
        """Numbers of the pixels at ``px`` ``(2, N)``, then of their neighbours to each side."""
        height, width = self.camera.size
        x, y = px.long()
        for dy, dx in NEIGHBORS:
            yield (y + dy).clamp(0, height - 1) * width + (x + dx).clamp(0, width - 1)

    def _on_plane(self, pixel: Tensor, at: Tensor, slack: Tensor) -> Tensor:
        """Whether points lie on the plane of a pixel's surface, measured along view z."""
        normal, depth = self.normal[:, pixel].T, self.depth[pixel]
        off = ((at - self._points(pixel)) * normal).sum(-1)
        way = torch.zeros_like(at) if self.camera.orthographic else at / at[:, 2:].clamp_min(1e-9)
        lean = normal[:, 2] if self.camera.orthographic else (normal * way).sum(-1)
        return depth.isfinite() & (off.abs() < slack * lean.abs()) & (lean.abs() > EDGE_ON)

    def _points(self, pixel: Tensor) -> Tensor:
        """``(N, 3)`` view-space points that pixels show."""
        camera, width = self.camera, self.camera.width
        px = torch.stack([pixel % width, pixel // width]).to(self.depth) + 0.5
        if camera.jitter is not None:
            px = px + camera.jitter[0].to(px)[:, None]
        return camera.unproject(self.depth[pixel][None, None, None], px[None, :, None])[0, :, 0].T


def begins_on_screen(
    scene: Scene,
    picture: Picture,
    origins: Tensor,
    directions: Tensor,
    *,
    poses: Tensor,
    t_min: Tensor | float,
    t_max: Tensor | float,
) -> Tensor:
    """Whether the first hit of rays from a lens, glass included, is on screen in a ``picture``.

    Args:
        scene: what is there.
        picture: what a camera shows.
        origins: ``(N, 3)`` world space.
        directions: ``(N, 3)`` world space, unit length.
        poses: ``(I, 4, 4)`` of the instances.
        t_min: where the rays begin, a number or ``(N,)``.
        t_max: where they end; the sky is beyond.

    Returns:
        ``(N,)`` bool.
    """
    hits = trace(scene, origins, directions, poses=poses, mask=MASK_PRIMARY, t_min=t_min, t_max=t_max)
    points = origins + directions * torch.where(hits.hit, hits.t, 0.0)[:, None]
    shows = picture.sees(*picture.back_project(points, hits.normal, hits.instance))
    return torch.where(hits.hit, shows, picture.shows_sky(directions))
