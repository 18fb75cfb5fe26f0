"""Set-up shared by the slice sweeps (GTAO, bitmask, screen-space GI): receivers and slices.

Planes are ``(B, h, w)`` rather than stacked channels, so that elementwise code fuses and stays in cache.
"""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt import Camera
from gbufrt.demands.pictures import check_pictures
from gbufrt.noise.noise import GOLDEN
from gbufrt.numeric import check_counts, check_numbers
from post.margin import reference as margin
from post.sweep.constants import BIAS, FIRST, MIN_FACING
from post.sweep.layout import Receivers, Receiving, Slice
from post.sweep.turns import tangents, turn

BAND_PIXELS = 32768  # pixels of all planes that fit one core's cache; also torch's smallest share of work for a thread
MOST_SCALES = 16
BELOW_ONE = 0.9999  # keeps sums with a dither from rounding up to the next whole number
WITHIN = 1.5  # exponent of the taps' spread in a sweep that ends at a radius
BEYOND = 2.5  # likewise in a sweep over the whole picture, where near surfaces count most


def receivers(pixels: Receiving) -> Receivers:
    """The receivers of a picture, with normals bent to face the eye."""
    camera, depth = pixels.camera, pixels.depth
    point = camera.unproject(depth)
    view = camera.to_eye(camera.unproject(torch.ones_like(depth)))
    n = camera.rotate_to_view(pixels.normal)
    facing = (n * view).sum(1, keepdim=True)
    n = n + view * (MIN_FACING - facing).clamp_min(0)
    n = n * (n * n).sum(1, keepdim=True).rsqrt()
    k = camera.intrinsics.to(depth.dtype)
    scale = k[:, :1, :1, None].expand_as(depth) if camera.orthographic else k[:, :1, :1, None] / depth.clamp_min(1e-9)
    first = margin.width(camera) + 1
    column = torch.arange(camera.width, dtype=depth.dtype, device=depth.device).add(first).expand_as(depth)
    row = torch.arange(camera.height, dtype=depth.dtype, device=depth.device)[:, None].add(first).expand_as(depth)
    planes = pixels.of(torch.cat([column, row, point, n, view, scale.detach()], dim=1)).contiguous()
    return Receivers(*planes.unbind(1), aspect=(k[:, 1, 1] / k[:, 0, 0])[:, None, None])


def bands(at: Receivers) -> list[tuple[slice, Receivers]]:
    """The receivers in bands of rows small enough to stay in cache: three times as fast as whole planes.

    Bands have one height where a divisor of the picture's height allows it, so that compiled code fits them all.
    """
    height, width = at.z.shape[-2:]
    threads = torch.get_num_threads()
    pixels = BAND_PIXELS * (1 if threads == 1 else 2 * threads)  # enough for every thread, or some spin idle
    most = max(1, min(height, pixels // (width * at.z.shape[0])))
    tall = next((rows for rows in range(most, most // 2, -1) if height % rows == 0), most)
    cuts = [slice(first, min(first + tall, height)) for first in range(0, height, tall)]
    return [(cut, Receivers(*(plane[:, cut] for plane in at[:-1]), aspect=at.aspect)) for cut in cuts]


def slice_noise(at: Receivers, noise: Tensor, which: int, directions: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Cosine and sine of the angle of slice ``which`` about the ray, and two numbers in [0, 1) for steps and sectors.

    Args:
        at: the receivers.
        noise: ``(3, h, w)`` in [0, 1).
        which: 0 to ``directions - 1``.
        directions: number of slices over half a turn.
    """
    return (
        *turn(at, (noise[0] + which) / directions),
        (noise[1] + which * GOLDEN) % 1.0,
        (noise[2] + which * GOLDEN) % 1.0 * BELOW_ONE,
    )


def tap_pixels(reach: Tensor, which: int, jitter: Tensor, steps: int, power: float) -> Tensor:
    """Pixels from the receiver to tap ``which`` of ``steps``; the larger the power, the denser the near taps."""
    return FIRST + reach * ((which + jitter) / steps) ** power


def cut_slice(at: Receivers, cos_psi: Tensor, sin_psi: Tensor) -> Slice:
    """The slices at angle psi about the rays, see `post.sweep.turns`."""
    (ax, ay, az), (bx, by, bz) = tangents(at)
    tx, ty, tz = cos_psi * ax + sin_psi * bx, cos_psi * ay + sin_psi * by, cos_psi * az + sin_psi * bz
    slide = tz / at.vz  # along the ray back into the picture's plane
    across = at.nx * tx + at.ny * ty + at.nz * tz
    toward = at.nx * at.vx + at.ny * at.vy + at.nz * at.vz
    projected = (across * across + toward * toward).sqrt()
    cos_n, sin_n = toward / projected, across / projected
    n = torch.atan2(sin_n, cos_n)
    measure = cos_n + n * sin_n
    nx, ny, nz = at.nx / projected, at.ny / projected, at.nz / projected
    across_x, across_y = cos_n * tx - sin_n * at.vx, cos_n * ty - sin_n * at.vy
    across_z = cos_n * tz - sin_n * at.vz
    return Slice(
        nx=nx,
        ny=ny,
        nz=nz,
        hx=cos_n * at.vx + sin_n * tx,
        hy=cos_n * at.vy + sin_n * ty,
        hz=cos_n * at.vz + sin_n * tz,
        tx=across_x,
        ty=across_y,
        tz=across_z,
        level=at.x * nx + at.y * ny + at.z * (nz + BIAS),
        place=at.x * across_x + at.y * across_y + at.z * across_z,
        cos_n=cos_n,
        sin_n=sin_n,
        n=n,
        measure=measure,
        weight=torch.ones_like(measure),
        step_x=(tx - slide * at.vx) * at.scale,
        step_y=(ty - slide * at.vy) * at.scale * at.aspect,
    )


def check_sweep(
    camera: Camera,
    directions: int,
    steps: int,
    radius: Tensor | float | None,
    scales: int = 1,
    **pictures: Tensor | float | None,
) -> None:
    """Raise ValueError or TypeError unless counts and radius are in range and the pictures, by name, fit the camera."""
    counts = {"directions": directions, "steps": steps, "scales": scales}
    check_counts(**counts)
    if radius is not None:
        check_numbers(radius=radius)
    for name, value in counts.items():
        if value < 1:
            raise ValueError(f"{name} must be at least 1, got {value}")
    if scales > MOST_SCALES:
        raise ValueError(f"scales must be at most {MOST_SCALES}, as each doubles the radius, got {scales}")
    if radius is not None and not bool(torch.as_tensor(radius) > 0):
        raise ValueError(f"radius and distance must be positive lengths in world units, got {float(radius):g}")
    check_pictures(camera, **pictures)
