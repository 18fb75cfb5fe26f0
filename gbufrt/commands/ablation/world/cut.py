"""The irradiance cache: what it gains after a cut, what bias it has, and how soon it forgets."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from gbufrt.commands.ablation.figures.display import display, displayed, exposure_of
from gbufrt.commands.ablation.figures.errors import Pair, psnr_over
from gbufrt.commands.ablation.place import Place
from gbufrt.commands.ablation.subjects import Outcome
from gbufrt.commands.ablation.world.pictures import compared_displays
from gbufrt.frame import Frame

if TYPE_CHECKING:
    from gbufrt.camera import Camera
    from tracer.cache.irradiance import IrradianceCache
    from tracer.scene.scene import Scene

SIZE = (54, 96)
RATIO = 2  # of the upscaler
CUTS = {"hall": ((173.5, 37.0, 79.5), (199.0, 33.5, 92.0), 58.0)}  # eye, target and angle after the cut
BEFORE = 16  # frames before it
NOISES = (0, 1, 2)  # seeds, each with a cache of its own
PATHS, TRUTH_PATHS = 48, 64  # a pixel: of perfect indirect light, of each half of the picture's truth
BOUNCES, MOST = 4, 12  # of paths in frames; of paths that hold nearly all light
MEANS = 12  # frames more, whose mean light is measured

ROOM = (30, 14, 18)  # voxels
LAMPS = ((4, 10, 5), (25, 10, 12))  # where the block that shines is, and where it is moved
KNOWN, LATER = 24, 8  # frames until the cache is full; frames after the move


def judge(place: Place) -> Outcome:
    """Decibels gained in the first displayed frame after a cut inside a room, by the mean and the least of `NOISES`;
    bias of the mean light of a converged frame; and the share of old light that is left after `LATER` frames.
    """
    place = replace(place, size=SIZE)
    result, gains, traced = Outcome(), list[float](), list[float]()
    there = cut_to(place)
    wanted, exposure = truth(place, RATIO)
    small, _ = truth(place, 1)
    scores: dict[str, list[float]] = {}
    for noise in NOISES:
        place.say(f"{place.view}, cut with noise {noise}")
        cache = None
        for index in range(BEFORE):
            _, cache = lit(place, place.camera(0.0), index, noise, cache)
        if noise == NOISES[0]:
            result.figures |= bias(place, cache)
        lights = {"ours": lit(place, there, BEFORE, noise, cache)[0]}
        lights["without"] = lights["ours"].replace(**plain(place, there, noise))
        lights["perfect"] = perfect(place, lights["without"])
        shown = {name: finished(frame, exposure) for name, frame in lights.items()}
        for which, size, halves in (("shown", 0, wanted), ("traced", 1, small)):
            for name, pair in shown.items():
                everywhere = torch.ones_like(pair[size][:, :1], dtype=torch.bool)
                scores.setdefault(f"{which}_{name}", []).append(psnr_over(pair[size], halves, everywhere))
        gains.append(scores["shown_ours"][-1] - scores["shown_without"][-1])
        traced.append(scores["traced_ours"][-1] - scores["traced_without"][-1])
        if noise == NOISES[0]:
            pictures = {name: pair[0] for name, pair in shown.items()}
            result.pictures = compared_displays("cut", pictures, (wanted[0] + wanted[1]) / 2)
    result.figures |= {f"cut.{name}": sum(all_) / len(all_) for name, all_ in scores.items()}
    result.figures |= {"cut.gain": sum(gains) / len(gains), "cut.least": min(gains)}
    result.figures |= {"cut.gain_traced": sum(traced) / len(traced), "cut.left": left(place), "cut.never": 1.0}
    result.figures["cut.perfect"] = result.figures["cut.shown_perfect"] - result.figures["cut.shown_without"]
    return result


def cut_to(place: Place) -> Camera:
    """The camera after the cut."""
    from gbufrt.camera import Camera

    eye, target, angle = CUTS[place.view]
    return Camera.look_at(eye, target, size=place.size, fov_y=angle)


def lit(
    place: Place, camera: Camera, index: int, noise: int, cache: IrradianceCache | None
) -> tuple[Frame, IrradianceCache]:
    """A frame of the world as it is at first, and the cache after it."""
    from tracer import render, sampled_with_cache

    frame = render(place.scene, camera, light_samples=1, index=index, previous_camera=camera)
    frame = frame.replace(behind=None, ambient=None)
    return sampled_with_cache(place.scene, frame, cache, seed=noise, bounces=BOUNCES)


def plain(place: Place, camera: Camera, noise: int) -> dict[str, Any]:
    """The light of `tracer.sampled` in the first frame after the cut, instead of the cache's."""
    from tracer import render, sampled

    frame = render(place.scene, camera, light_samples=1, index=BEFORE, previous_camera=camera)
    found = sampled(place.scene, frame.replace(behind=None), seed=noise, bounces=BOUNCES)
    names = ("diffuse", "indirect", "specular", "reflection_distance", "shadow")
    return {**{name: found.read(name) for name in names}, "cached_diffuse": None}


def perfect(place: Place, frame: Frame) -> Frame:
    """A frame whose indirect diffuse light has no noise."""
    indirect = means(place, frame, BOUNCES)["indirect"]
    exact = frame.read("diffuse") - frame.read("indirect") + indirect
    return frame.replace(diffuse=exact, cached_diffuse=exact)


def means(place: Place, frame: Frame, bounces: int) -> dict[str, Tensor]:
    """Diffuse, indirect and specular light of a frame by many paths."""
    from tracer import light_truth

    def make() -> dict[str, Tensor]:
        place.say(f"{place.view}, light of {bounces} bounces")
        poses = place.scene.poses([0.0])
        found = light_truth(place.scene, frame.gbuffer, poses=poses, bounces=bounces, samples=PATHS)
        return {name: getattr(found, name) for name in ("diffuse", "indirect", "specular")}

    return dict(place.kept("means", frame.gbuffer.camera, [0.0], (PATHS, bounces), make))


def truth(place: Place, ratio: int) -> tuple[Pair, float]:
    """Two displayed halves of the path-traced frame at ``ratio`` times the sides, and the exposure."""
    from tracer import path_trace

    large = cut_to(replace(place, size=(place.size[0] * ratio, place.size[1] * ratio)))

    def make() -> dict[str, Tensor]:
        place.say(f"{place.view}, truth after the cut")
        given: dict[str, Any] = {"time": 0.0, "samples": TRUTH_PATHS, "bounces": BOUNCES}
        given["antialias"] = ratio > 1  # what is traced has one sample a pixel
        halves = (path_trace(place.scene, large, seed=seed, **given) for seed in (1, 2))
        return dict(zip(("first", "second"), (half["radiance"] for half in halves), strict=True))

    kept = place.kept("after the cut", large, [0.0], (TRUTH_PATHS, BOUNCES, ratio), make)
    both = kept["first"], kept["second"]
    exposure = exposure_of((both[0] + both[1]) / 2, torch.ones_like(both[0][:, :1], dtype=torch.bool))
    return displayed(both, exposure), exposure


def finished(frame: Frame, exposure: float) -> tuple[Tensor, Tensor]:
    """Displayed: what `minecraft_rtx` upscales from a frame without a history, and the composite before."""
    from post import minecraft_rtx

    pipeline = minecraft_rtx("high").without("display")
    with torch.no_grad():
        after, _ = pipeline(frame)
    return display(after.read("color"), exposure), display(after.read("composite"), exposure)


def bias(place: Place, cache: IrradianceCache | None) -> dict[str, float]:
    """The mean light of frames whose cache has converged, over that of paths, less 1: of all light, and of indirect."""
    found, frame = [], lit(place, place.camera(0.0), 0, NOISES[0], None)[0]
    for index in range(BEFORE, BEFORE + MEANS):
        frame, cache = lit(place, place.camera(0.0), index, NOISES[0], cache)
        found.append(_mean_light(frame, {name: frame.read(name) for name in ("diffuse", "indirect", "specular")}))
    ours = [sum(values) / len(values) for values in zip(*found, strict=True)]
    figures = {}
    for bounces in (BOUNCES, MOST):
        true = _mean_light(frame, means(place, frame, bounces))
        figures |= {f"cut.bias_{bounces}": ours[0] / true[0] - 1, f"cut.bias_indirect_{bounces}": ours[1] / true[1] - 1}
    sizes = {"cut.bias": abs(figures[f"cut.bias_{BOUNCES}"]), "cut.bias_most": abs(figures[f"cut.bias_{MOST}"])}
    return {**figures, **sizes}


def _mean_light(frame: Frame, light: dict[str, Tensor]) -> tuple[float, float]:
    """Mean light of the surfaces, all of it and the indirect diffuse part."""
    hit, albedo = frame.gbuffer.hit, frame.read("albedo")
    whole = frame.read("emission") + albedo * light["diffuse"] + light["specular"]
    return tuple(float(x.mean(1, keepdim=True)[hit].mean()) for x in (whole, albedo * light["indirect"]))  # pyright: ignore[reportReturnType]


def left(place: Place) -> float:
    """The share of the old light that surfaces still have, `LATER` frames after the block that shines was moved."""
    from gbufrt.camera import Camera

    place.say("a lamp is moved")
    camera = Camera.look_at((ROOM[0] - 2.0, ROOM[1] - 4.0, ROOM[2] - 2.0), (6.0, 4.0, 4.0), size=place.size, fov_y=70.0)
    old, cache = _cached(room(LAMPS[0]), camera, KNOWN)
    found, _ = _cached(room(LAMPS[1]), camera, LATER, cache)
    new, _ = _cached(room(LAMPS[1]), camera, KNOWN)
    dark = old > new
    return float((found - new)[dark].sum() / (old - new)[dark].sum())


def room(lamp: tuple[int, int, int]) -> Scene:
    """A grey room with a wall across half of it, and one block that shines."""
    from tracer import Material, MaterialTable, Scene, World

    table = MaterialTable.of(
        [
            Material(name="plaster", albedo=(0.6, 0.6, 0.6), variation=0.0),
            Material(name="lamp", emission=(30.0, 30.0, 30.0)),
        ]
    )
    voxels = torch.ones(ROOM, dtype=torch.int16)
    voxels[1:-1, 1:-1, 1:-1] = 0
    voxels[ROOM[0] // 2, 1:-1, : ROOM[2] // 2] = 1
    voxels[lamp] = 2
    return Scene(world=World.from_dense(voxels, table))


def _cached(
    scene: Scene, camera: Camera, frames: int, cache: IrradianceCache | None = None
) -> tuple[Tensor, IrradianceCache]:
    """Indirect light that the cache holds for what the camera sees after some frames, and the cache."""
    from tracer import IrradianceCache, render, sampled_with_cache

    cache = cache or IrradianceCache.empty()
    still = render(scene, camera, light_samples=1).replace(behind=None)
    for index in range(frames):
        still, cache = sampled_with_cache(scene, still.replace(index=index), cache, bounces=BOUNCES)
    return still.read("cached_diffuse") - still.read("diffuse") + still.read("indirect"), cache
