"""Fog before the surfaces of a frame, behind the transmissive ones, and along mirrored rays."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Frame, GBuffer
from gbufrt.compute.resident import waits
from gbufrt.directions import length
from gbufrt.noise.noise import blue_noise
from gbufrt.reduction import every_nth
from tracer.direct.lighting import batched, lifted
from tracer.fog.scattered import scattered
from tracer.fog.segments import Segments, passes
from tracer.sampling.scatter import mirrored
from tracer.scene.scene import MASK_SECONDARY, Scene
from tracer.traversal.rays import trace

STRIDE = 2  # along mirrored rays, light is sampled at every second pixel both ways
DIMS = 10  # numbers in [0, 1) that `scattered` takes
MIRROR = 0.4  # perceptual roughness up to which fog is marched along the mirrored ray


def foggy(scene: Scene, frame: Frame, *, poses: Tensor, index: int = 0) -> Frame:
    """A frame with the light and the transmittance of the scene's fog, and the same of what lies behind.

    Args:
        scene: with fog.
        frame: what the tracer saw.
        poses: ``(B, I, 4, 4)`` of the scene's instances.
        index: frame number, from which the noise comes.
    """
    zero = torch.zeros_like(frame.gbuffer.depth)
    poses = batched(poses, frame.gbuffer.batch, len(scene.instances))
    lit = _with_light(scene, frame, zero, distances(frame.gbuffer), poses, index, 0)
    small = every_nth(frame, STRIDE).gbuffer
    if small.roughness is not None and (waits(zero) or bool((small.hit & (small.roughness <= MIRROR)).any())):
        lit = lit.replace(fog_mirrored=_mirrored(scene, small, poses, index))
    behind = frame.behind
    if behind is None:
        return lit
    g, first = behind.gbuffer, frame.gbuffer
    solid = zero if first.thickness is None else first.thickness
    clear = first.transmittance
    shows = zero + 1 if clear is None else (clear.amax(dim=1, keepdim=True) > 0).to(zero)
    begin = distances(first) + solid
    end = torch.where(shows > 0, distances(g), begin)
    return lit.replace(behind=_with_light(scene, behind, begin, end, poses, index, 1))


def distances(g: GBuffer) -> Tensor:
    """``(B, 1, H, W)`` from the camera's origin along each pixel's ray to the surface, or to the far plane."""
    origins, _ = g.camera.rays()
    depth = torch.where(g.hit, g.depth, g.camera.far)
    return length(g.camera.to_world(g.camera.unproject(depth)) - origins.permute(0, 3, 1, 2))


def segments_of(g: GBuffer, number: int) -> Segments:
    """The rays of one picture of a batch from its camera to the surfaces, or to the far plane; row by row."""
    origins, directions = g.camera.rays()
    end = distances(g)[number, 0]
    return _flat(origins[number], directions[number], torch.zeros_like(end), end)


def _with_light(scene: Scene, frame: Frame, begin: Tensor, end: Tensor, poses: Tensor, index: int, seed: int) -> Frame:
    (origins, directions), size = frame.gbuffer.camera.rays(), frame.gbuffer.camera.size
    fog, clear, light = scene.fog, [], []
    assert fog is not None
    noise = blue_noise(*size, dims=DIMS, seed=seed, device=origins.device)
    for b in range(frame.gbuffer.batch):
        rays = _flat(origins[b], directions[b], begin[b, 0], end[b, 0])
        clear.append(passes(fog, rays).view(1, *size))
        light.append(scattered(scene, rays, noise, poses=poses[b], index=index).T.view(3, *size))
    return frame.replace(fog_transmittance=torch.stack(clear), fog_light=torch.stack(light))


def _mirrored(scene: Scene, g: GBuffer, poses: Tensor, index: int) -> Tensor:
    """``(B, 4, h, w)`` light and transmittance of the fog along the mirrored rays of smooth surfaces."""
    assert scene.fog is not None
    assert g.roughness is not None
    ways = mirrored(g.camera.rays()[1], g.normal.permute(0, 2, 3, 1))
    points = lifted(g).permute(0, 2, 3, 1)
    hits = trace(scene, points, ways, poses=poses, mask=MASK_SECONDARY)
    smooth = g.hit[:, 0] & (g.roughness[:, 0] <= MIRROR)
    end = torch.where(smooth, torch.where(hits.hit, hits.t, g.camera.far), 0.0)
    found = []
    for b in range(g.batch):
        noise = blue_noise(*g.camera.size, dims=DIMS, seed=2, device=points.device)
        some = _flat(points[b], ways[b], torch.zeros_like(end[b]), end[b])
        light = scattered(scene, some, noise, poses=poses[b], index=index, coherent=False)
        found.append(torch.cat([light, passes(scene.fog, some)[:, None]], dim=1).T.view(4, *g.camera.size))
    return torch.stack(found)


def _flat(origins: Tensor, directions: Tensor, begin: Tensor, end: Tensor) -> Segments:
    return Segments(
        origins=origins.reshape(-1, 3),
        directions=directions.reshape(-1, 3),
        begin=begin.reshape(-1),
        end=end.reshape(-1),
    )
