"""The README's table of estimates: how far each is from the true channel, over six views of the built-in world."""

import torch

import tracer
from gbufrt import Frame, GBuffer
from post import EstimateMissing, motion_from_depth, normals_from_depth

VIEWS = ("village", "lake", "cave", "plaza", "hall", "closeup")
SIZE, STEP, MOVES = (270, 480), 1 / 24, 0.1  # pixels, seconds a frame, pixels that something moves by itself

scene = tracer.load("valley")
found: dict[str, list[torch.Tensor]] = {}


def note(name: str, error: torch.Tensor, where: torch.Tensor) -> None:
    found.setdefault(name, []).append(error.expand_as(where)[where])


def degrees(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return torch.rad2deg(torch.arccos((a * b).sum(1, keepdim=True).clamp(-1, 1)))


for name in VIEWS:
    camera, past = (scene.views[name].camera(time, size=SIZE) for time in (1.0, 1.0 - STEP))
    before = tracer.gbuffer(scene, past, time=1.0 - STEP)
    g = tracer.gbuffer(scene, camera, previous_camera=past, time=1.0, previous_time=1.0 - STEP)
    true = Frame(gbuffer=g)
    hit, static = g.hit, camera.static_motion(past, g.depth, g.hit)[0]
    bare = GBuffer(camera=camera, depth=g.depth, hit=hit, normal=g.normal, albedo=g.albedo)
    guess = EstimateMissing()(Frame(gbuffer=bare))
    for method in ("plain", "edge_aware"):
        normal = normals_from_depth(g.depth, camera, hit=hit, method=method)
        note(f"normal, {method}: degrees", degrees(normal, true.read("normal_geo")), hit)
    moves = hit & ((true.read("motion") - static).norm(dim=1, keepdim=True) > MOVES)
    for radius in (0, 2, 8):
        motion, _ = motion_from_depth(g.depth, camera, before.depth, past, hit=hit, radius=radius)
        error = (motion - true.read("motion")).norm(dim=1, keepdim=True)
        note(f"motion, searched {radius} px: of what moves, px", error, moves)
        note(f"motion, searched {radius} px: of the rest, px", error, hit & ~moves)
    for channel in ("roughness", "metallic"):
        usual = float(channel == "roughness")
        note(channel, (guess.read(channel) - true.read(channel)).abs(), hit)
        note(f"{channel}, {usual:g} everywhere instead", (true.read(channel) - usual).abs(), hit)
    factor = guess.read("thickness").clamp_min(1e-3) / true.read("thickness").clamp_min(1e-3)
    note("thickness: powers of two", factor.log2().abs(), hit)
for name, parts in found.items():
    errors = torch.cat(parts)
    most = errors.kthvalue(int(0.95 * len(errors)) + 1).values
    print(f"{name}: median {errors.median():.3g}, mean {errors.mean():.3g}, 95 % below {most:.3g}")
