"""From a scene and a camera to a frame that passes can work on."""

from __future__ import annotations

import math
from collections.abc import Sequence

from torch import Tensor

from gbufrt import Camera, Frame, GBuffer
from gbufrt.compute.resident import sent
from gbufrt.numeric import check_between, check_counts
from tracer.direct.fog import foggy
from tracer.direct.lighting import backdrop, light
from tracer.gbuffers import layers
from tracer.lights.sky import environment
from tracer.scene.scene import Scene
from tracer.scene.times import seconds
from tracer.underwater.frames import submerged


def render(
    scene: Scene,
    camera: Camera,
    *,
    previous_camera: Camera | None = None,
    time: float | Tensor | Sequence[float] = 0.0,
    previous_time: float | Tensor | Sequence[float] | None = None,
    index: int = 0,
    light_samples: int = 16,
) -> Frame:
    """Trace a scene: G-buffer, direct light, sky light, and the layer behind transmissive surfaces.

    Args:
        scene: what is there and what lights it.
        camera: B cameras; their jitter is honoured.
        previous_camera: where they were a frame ago; by default where they are.
        time: seconds, one number or B.
        previous_time: of the frame before; by default ``time``, so that nothing moves.
        index: frame number, from which the noise comes.
        light_samples: most shadow rays a pixel to each light; 0 for emission and sky alone, where `sampled` or
            `one_path` will light the frame.

    Returns:
        A frame with ``radiance``, ``ambient`` and ``environment``; in fog with its light and transmittance; and
        ``behind`` where the scene has transmissive materials; ``emitters_sampled`` is True where lamps are sampled.

    Raises:
        ValueError: no voxels, or times, cameras or counts that do not fit.
    """
    check_counts(index=index, light_samples=light_samples)
    check_between(0, math.inf, light_samples=light_samples)
    first, second = layers(scene, camera, previous_camera=previous_camera, time=time, previous_time=previous_time)
    times = seconds(time, camera.batch)
    poses = sent(scene.poses(times), camera.position)
    picture = environment(scene).to(camera.device)
    picture, sky = picture.expand(camera.batch, *picture.shape[1:]), backdrop(scene, first.camera)

    def lit(gbuffer: GBuffer, behind: Frame | None, seen: Tensor | None = None) -> Frame:
        given = {"samples": light_samples, "index": index, "times": times, "seen": seen, "sky": sky}
        radiance, ambient = light(scene, gbuffer, poses=poses, **given)
        return Frame(
            gbuffer=gbuffer,
            index=index,
            time=times[0],
            radiance=radiance,
            ambient=ambient,
            environment=picture,
            emitters_sampled=light_samples > 0,
            behind=behind,
        )

    through = None if first.transmittance is None else first.transmittance.amax(dim=1, keepdim=True)
    frame = lit(first, None if second is None else lit(second, None, through))
    frame = submerged(scene, frame, poses=poses)
    return frame if scene.fog is None else foggy(scene, frame, poses=poses, index=index)


def unlit(scene: Scene, camera: Camera, *, time: float = 0.0, index: int = 0) -> Frame:
    """As `render`, without light and motion: what `tracer.sampled` needs of the frame before."""
    first, second = layers(scene, camera, time=time)
    behind = None if second is None else Frame(gbuffer=second, index=index, time=time)
    return Frame(gbuffer=first, index=index, time=time, behind=behind)
