"""A scene as the flat tables that compiled paths read, where the scene lies."""

from __future__ import annotations

import torch
from torch import Tensor

from gbufrt.compute.resident import resident
from tracer.lights.samples import Lights
from tracer.lights.tables import lit_tables
from tracer.paths.on_screen import Picture
from tracer.paths.surfaces.vertices import Vertices
from tracer.scene.material import MaterialTable
from tracer.scene.scene import Scene
from tracer.scene.textures import Textures
from tracer.traversal.rays import grid_from_world

COLUMNS = {
    "points": 3,
    "normals": 3,
    "toward": 3,
    "albedo": 3,
    "roughness": 1,
    "metallic": 1,
    "opacity": 1,
    "emission": 3,
    "inside": 1,
    "instances": 1,
}
"""Of `Vertices`, side by side, as `tracer.paths.interaction_kernel.surface_of` reads them."""


def arrays_of(scene: Scene, poses: Tensor, lights: Lights | None = None) -> tuple[Tensor, ...]:
    """The tables that `interaction_kernel.assembled` takes: the scene at ``poses``, with its lights where wanted."""
    materials, texels = _materials(scene.materials)
    tables = (
        grid_from_world(scene, poses, poses.device)[0],
        *scene.grids.tensors,
        materials,
        texels,
        *lit_tables(scene, lights, materials),
    )
    return tuple(table.contiguous() for table in tables)


def _materials(table: MaterialTable) -> tuple[Tensor, Tensor]:
    """See `interaction_kernel.Tables`: a face without a texture shows the one texel that is its material."""
    textures, flat = table.textures or Textures.none(len(table), table.albedo), torch.zeros_like(table.tint[:, :2])
    first, side = textures.faces.float().unbind(dim=-1)
    columns = [table.opacity[:, None], table.tint, table.variation[:, None], first + len(table), side]
    own = [table.albedo, flat, table.roughness[:, None], table.metallic[:, None], table.emission]
    return torch.cat(columns, dim=1), torch.cat([torch.cat(own, dim=1), textures.texels])


def surfaces_of(vertices: Vertices) -> Tensor:
    """``(N, 20)`` float32."""
    columns = [getattr(vertices, name).reshape(-1, width).float() for name, width in COLUMNS.items()]
    return torch.cat(columns, dim=1)


def camera_of(picture: Picture | None, device: torch.device) -> Tensor:
    """``(27,)`` float64 that `on_screen_kernel.sees` reads of a picture's camera, empty for none; and 12 more for each
    instance, if any has moved since, for `on_screen_kernel.back_project`."""
    if picture is None:
        return torch.zeros(0, dtype=torch.float64, device=device)
    camera = picture.camera
    k, jitter = camera.intrinsics[0].double(), camera.jitter
    numbers = [
        camera.view_from_world[0, :3].double().flatten(),
        k.diagonal()[:2],
        k[:2, 2],
        k.new_zeros(2) if jitter is None else jitter[0].double(),
        camera.position[0].double(),
        camera.forward[0].double(),
        resident((float(camera.orthographic), *camera.size), k),
    ]
    if picture.back is not None:
        numbers.append(picture.back[1:].double().flatten())
    return torch.cat([part.to(device) for part in numbers])


def picture_of(picture: Picture | None, device: torch.device) -> Tensor:
    """``(4, H * W)`` float32: depth and normal of each pixel; none for no picture."""
    if picture is None:
        return torch.zeros(4, 0, device=device)
    return torch.cat([picture.depth[None], picture.normal]).to(device)
