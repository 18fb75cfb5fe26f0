"""Which points in a world a picture shows."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from gbufrt import GBuffer
from gbufrt.camera import Camera

SLACK = 2.0  # pixels' width by which depths may differ: surfaces show more detail than the picture resolves
EDGE_ON = 0.02  # sine below which a pixel's plane is too steep to be continued over the pixel
NEIGHBORS = ((0, 0), (0, 1), (0, -1), (1, 0), (-1, 0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """What one camera sees, flat.

    Args:
        camera: one camera.
        depth: ``(H * W,)`` planar, inf where nothing was hit.
        normal: ``(H * W, 3)`` of the surfaces, view space.
        point: ``(H * W, 3)`` of the surfaces, view space.
    """

    camera: Camera
    depth: Tensor
    normal: Tensor
    point: Tensor

    @staticmethod
    def of(gbuffer: GBuffer, number: int) -> Picture:
        """Picture ``number`` of the batch."""
        camera, normal = gbuffer.camera, gbuffer.normal if gbuffer.normal_geo is None else gbuffer.normal_geo
        only = Camera(
            intrinsics=camera.intrinsics[number : number + 1],
            world_from_view=camera.world_from_view[number : number + 1],
            size=camera.size,
            near=camera.near,
            far=camera.far,
            orthographic=camera.orthographic,
            jitter=None if camera.jitter is None else camera.jitter[number : number + 1],
        )
        return Picture(
            camera=only,
            depth=torch.where(gbuffer.hit, gbuffer.depth, torch.inf)[number].flatten().float(),
            normal=camera.rotate_to_view(normal)[number].flatten(1).T.contiguous().float(),
            point=gbuffer.points_view()[number].flatten(1).T.contiguous().float(),
        )

    def sees(self, points: Tensor, normals: Tensor) -> Tensor:
        """Whether points on surfaces show in the picture.

        They must face the camera and fall inside the picture, and the depth of the pixel there, or of one of its four
        neighbours, must be theirs: to within two pixels' width, which is the detail that a picture cannot resolve, as
        the pixel's surface stands or continued to where the point falls.

        Args:
            points: ``(N, 3)`` world space.
            normals: ``(N, 3)`` of the surfaces there, world space.

        Returns:
            ``(N,)`` bool.
        """
        camera, (height, width) = self.camera, self.camera.size
        view = camera.to_view(points.T[None])
        z = view[0, 2]
        px = camera.project(view, jittered=True)[0]
        toward = camera.forward[0].expand_as(points) if camera.orthographic else points - camera.position[0]
        faces = (toward * normals).sum(-1) < 0
        within = faces & (z > 0) & (px[0] >= 0) & (px[0] < width) & (px[1] >= 0) & (px[1] < height)
        found = torch.zeros_like(within)
        rows = within.nonzero()[:, 0]
        z, at = z[rows], view[0, :, rows].T
        x, y = px[0, rows].long(), px[1, rows].long()
        slack = SLACK / camera.pixels_per_unit(z[None])[0]
        agrees = torch.zeros_like(rows, dtype=torch.bool)
        for dy, dx in NEIGHBORS:
            pixel = (y + dy).clamp(0, height - 1) * width + (x + dx).clamp(0, width - 1)
            agrees |= ((self.depth[pixel] - z).abs() < slack) | self._on_plane(pixel, at, slack)
        found[rows] = agrees
        return found

    def _on_plane(self, pixel: Tensor, at: Tensor, slack: Tensor) -> Tensor:
        """Whether points lie on the plane of a pixel's surface, measured along view z."""
        normal, depth = self.normal[pixel], self.depth[pixel]
        off = ((at - self.point[pixel]) * normal).sum(-1)
        way = torch.zeros_like(at) if self.camera.orthographic else at / at[:, 2:].clamp_min(1e-9)
        lean = normal[:, 2] if self.camera.orthographic else (normal * way).sum(-1)
        return depth.isfinite() & (off.abs() < slack * lean.abs()) & (lean.abs() > EDGE_ON)
