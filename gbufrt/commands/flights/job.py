"""Jobs: what is to be traced, and the frames of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any
from weakref import ref

from gbufrt.commands.arguments.checks import WINDOW, check_part, check_world
from gbufrt.commands.arguments.values import MOST_COUNT, MOST_FRAMES, at_least
from gbufrt.commands.arguments.world import DayOptions, FogOptions, PartOptions
from gbufrt.commands.flights.day import under
from gbufrt.commands.flights.standpoint import Standpoint

if TYPE_CHECKING:
    from torch import Tensor

    from gbufrt.commands.flights.sampling import Sampling
    from gbufrt.frame import Frame
    from tracer.cache.irradiance import IrradianceCache
    from tracer.scene.scene import Scene
    from tracer.worlds.regions.stream import Stream

BOUNCES = 4  # of sampled light, as `tracer.path_trace` has by default


@dataclass(kw_only=True)
class Left:
    """What the frames of a shot leave for those after them."""

    light: IrradianceCache | None = None
    samples: tuple[int, list[dict[str, Tensor | None]]] = (-1, [])
    """Number of the last frame, and the sampled light of each of its layers, as its file holds it."""
    surfaces: tuple[ref[Scene], Frame] | None = None
    """The scene of the last frame that was traced, and its surfaces, not rounded as in its file."""

    def seen(self, scene: Scene, index: int) -> Frame | None:
        """The surfaces of a frame, where it is the last one and the scene is still its own."""
        if self.surfaces is None or self.surfaces[0]() is not scene or self.surfaces[1].index != index:
            return None
        return self.surfaces[1]

    def keep(self, frame: Frame) -> Frame:
        """The frame, of which the sampled light is kept."""
        layers, of = [], frame
        while of is not None:
            layers.append({"diffuse": of.diffuse, "specular": of.specular})
            of = of.behind
        self.samples = int(frame.index), layers
        return frame


@dataclass(frozen=True, kw_only=True)
class Job:
    """What is to be traced."""

    world: str
    standpoint: Standpoint
    size: tuple[int, int]
    frames: int
    time: float
    fps: float
    samples: int | None
    seed: int | None
    part: PartOptions = field(default_factory=PartOptions)
    day: DayOptions = field(default_factory=DayOptions)
    fog: FogOptions = field(default_factory=FogOptions)

    def check(self) -> None:
        """Check the values, as far as possible without loading the world.

        Raises:
            ValueError: a number that makes no sense; there is no such world or view.
            FileNotFoundError: there is no such file.
        """
        at_least("--frames", self.frames, 1, MOST_FRAMES)
        at_least("--time", self.time, 0.0)
        at_least("--fps", self.fps, 1e-3)
        if self.samples is not None:
            at_least("--light-samples", self.samples, 1, MOST_COUNT)
        self.standpoint.check(self.frames)
        if self.part.window is not None:
            at_least("--window", self.part.window, *WINDOW)
        part = self.part.parsed()
        view = self.standpoint.view
        check_world(self.world, () if view is None else (view,), seed=self.seed)
        check_part(self.world, part)
        self.day.parsed()
        self.fog.parsed()

    def load(self) -> Scene | Stream:
        """The world, or with a window what reads it as the camera flies.

        Raises:
            ValueError: there is no such world or view, or nothing in it.
            FileNotFoundError: there is no such file.
        """
        from tracer.worlds import WORLDS, builtin, load
        from tracer.worlds.regions.stream import stream

        if self.part.window is not None:
            scene = stream(self.world, **self.part.parsed())
        elif self.seed is None:
            scene = load(self.world, **self.part.parsed())
        elif self.world == "builtin" or self.world in WORLDS:
            scene = WORLDS.get(self.world, builtin)(seed=self.seed)
        else:
            raise ValueError(f"--seed is for built-in worlds ({', '.join(WORLDS)}); leave it out for {self.world}")
        scene = under(scene, self.day)
        if scene.empty:
            raise ValueError(f"world {self.world!r} is empty: it holds no voxels; give one that does")
        self.standpoint.check_in(scene, self.world)
        if (fog := self.fog.parsed()) is not None:
            from tracer.scene.fog import Fog

            base = float(self.standpoint.eye_at(scene, 0, self.time)[1])
            scene = replace(scene, fog=Fog(extinction=fog["extinction"], falloff=fog["falloff"], base=base))
        return scene

    def notes(self) -> dict[str, Any]:
        """What a frame depends on, as JSON values."""
        keys = ("world", "time", "fps", "samples", "seed")
        part = {
            key: value
            for key, value in (asdict(self.part) | asdict(self.day) | asdict(self.fog)).items()
            if value is not None
        }
        return {"size": list(self.size), **{key: getattr(self, key) for key in keys}, **self.standpoint.notes(), **part}

    def trace(
        self,
        scene: Scene | Stream,
        index: int,
        device: Any,
        sampling: Sampling,
        *,
        still: int | None = None,
        left: Left | None = None,
    ) -> Frame:
        """G-buffer and light of one frame.

        Args:
            scene: the world.
            index: which frame.
            device: where to trace.
            sampling: how.
            still: number of a frame that stands as if it were this one, with noise of its own.
            left: what the frames before have left; where the sampling says so, this one adds its light.
        """
        import torch

        from gbufrt.noise.noise import halton_jitter
        from tracer.frames import render as trace_frame
        from tracer.frames import unlit
        from tracer.paths.sampled import sampled, sampled_with_cache
        from tracer.truth.one_path import one_path

        number, size = index if still is None else still, sampling.rendered(self.size)
        cut = self.standpoint.cuts_at(index)
        before = index if cut or still is not None else index - 1

        def camera(at: int, turn: int) -> Any:
            posed = self.standpoint.camera(scene, at, self.time + at / self.fps, size=size, of=self.size)
            jitter = halton_jitter(turn, length=sampling.jitter) if sampling.jitter else None
            return posed.with_jitter(jitter).to(device)

        more = {} if self.samples is None else {"light_samples": self.samples}
        there = scene.around(self.standpoint.eye_at(scene, index, self.time + index / self.fps))
        frame = trace_frame(
            there,
            camera(index, number),
            previous_camera=camera(before, number - 1),
            time=self.time + index / self.fps,
            previous_time=self.time + before / self.fps,
            index=number,
            **({"light_samples": 0} if sampling.paths else more),  # paths bring it
        )
        frame = frame.replace(cut=torch.ones(1, dtype=torch.bool, device=device)) if cut else frame
        if sampling.paths is None:
            return frame
        if sampling.paths == "denoise":
            return one_path(there, frame, bounces=BOUNCES)
        last = None
        if before == index - 1 and index > 0:
            last = None if left is None else left.seen(there, before)
            if last is None:  # traced again, so that no frame needs another's files
                last = unlit(there, camera(before, before), time=self.time + before / self.fps, index=before)
            if left is not None and left.samples[0] == before:
                last = with_samples(last, left.samples[1])
        if still is None and left is not None:
            left.surfaces = ref(there), frame.only(("behind", *frame.gbuffer.present))
        if not sampling.cached or left is None:
            return without_ambient(sampled(there, frame, before=last, bounces=BOUNCES))
        frame, left.light = sampled_with_cache(there, frame, left.light, before=last, bounces=BOUNCES)
        return without_ambient(frame)


def with_samples(frame: Frame, layers: list[dict[str, Tensor | None]]) -> Frame:
    """A frame with its sampled light, by which pixels are chosen to be replayed; and what lies behind with its own."""
    behind = with_samples(frame.behind, layers[1:]) if frame.behind is not None and layers[1:] else frame.behind
    return frame.replace(behind=behind, **layers[0])


def without_ambient(frame: Frame) -> Frame:
    """The frame without open sky, which sampled light holds, and the same of what lies behind."""
    behind = None if frame.behind is None else without_ambient(frame.behind)
    return frame.replace(ambient=None, behind=behind)
