"""Place: one view of one world, with the frames and the truth that it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from gbufrt.commands.ablation.cache import Cache, digest, sources
from gbufrt.frame import Frame
from gbufrt.gbuffer import GBuffer

if TYPE_CHECKING:
    from gbufrt.camera import Camera
    from tracer.scene.scene import Scene

TRACED_BY = ("tracer", *(f"gbufrt.{name}" for name in ("camera", "environment", "noise", "sampling", "specular")))
"""What shapes the truth."""
SHARES = {"ambient_occlusion": 4, "indirect_diffuse": 4, "reflection": 6}  # of --samples, for what is cheaper to trace

Truth = Mapping[str, Tensor]
Settings = Mapping[str, Any]
NONE: Settings = MappingProxyType({})
Say = Callable[[str], Any]


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where frames come from.

    Args:
        scene: the world.
        world: its name.
        view: the view's name.
        size: ``(H, W)``.
        samples: paths a pixel for truth, see `SHARES`.
        cache: where it is kept.
        time: seconds into the scene.
        fps: frames a second of the scene's time.
        light_samples: most shadow rays a pixel to each light, for frames.
        say: called with a line of progress.
    """

    scene: Scene
    world: str
    view: str
    size: tuple[int, int]
    samples: int
    cache: Cache
    time: float = 0.0
    fps: float = 24.0
    light_samples: int = 16
    say: Say = field(default=lambda _: None)

    @cached_property
    def contents(self) -> str:
        """A name for the contents of the world, whatever their poses."""
        return digest(self.scene)

    def at(self, frame: int) -> float:
        """Seconds of the scene at a frame number."""
        return self.time + frame / self.fps

    def camera(self, time: float | None = None) -> Camera:
        """The view's camera."""
        return self.scene.views[self.view].camera(self.time if time is None else time, size=self.size)

    def still(self, jitter: int | None = None) -> Frame:
        """The frame at `time`, as if nothing ever moved; ``jitter`` chooses a step of TAA's sequence."""
        from gbufrt.noise.noise import halton_jitter
        from tracer.frames import render

        camera = self.camera().with_jitter(None if jitter is None else halton_jitter(jitter))

        def make() -> Frame:
            self.say(f"tracing {self.view}")
            options: dict[str, Any] = {"time": self.time, "light_samples": self.light_samples}
            return render(self.scene, camera, previous_camera=camera, **options)

        return self.cache.frame(self._stem("still", camera, [self.time], self.light_samples), make)

    def moving(self, number: int, light_samples: int) -> Frame:
        """Frame ``number`` of the moving path: camera and world go on by a frame's time."""
        from tracer.frames import render

        now, before = self.at(number), self.at(number - 1)
        camera, previous = self.camera(now), self.camera(before)

        def make() -> Frame:
            self.say(f"tracing {self.view}, frame {number}")
            options: dict[str, Any] = {"index": number, "light_samples": light_samples}
            return render(
                self.scene, camera, previous_camera=previous, time=now, previous_time=before, **options
            )  # fmt: skip

        return self.cache.frame(self._stem("moving", (camera, previous), [now, before], light_samples, number), make)

    def geometry(self, number: int) -> GBuffer:
        """The G-buffer alone of frame ``number`` of the moving path; the sky's motion included."""
        from tracer.gbuffers import gbuffer

        now, before = self.at(number), self.at(number - 1)
        return gbuffer(
            self.scene, self.camera(now), previous_camera=self.camera(before), time=now, previous_time=before
        )

    def truth_of(self, integrator: str, gbuffer: GBuffer, settings: Settings = NONE) -> Truth:
        """What an integrator of `tracer.truth.truth` finds at the pixels of a G-buffer.

        Two independent halves of the paths, ``<name>_first`` and ``<name>_second``, and their mean ``<name>``.
        """
        from tracer.truth import truth

        samples, poses = self.samples * SHARES[integrator], self.scene.poses([self.time])

        def half(seed: int) -> Truth:
            found = getattr(truth, integrator)(
                self.scene,
                gbuffer,
                poses=poses,
                samples=max(samples // 2, 1),
                seed=seed,
                progress=self._counted(integrator),
                **settings,
            )
            return _flat(found)

        def make() -> Truth:
            return _joined(half(0), half(1))

        stem = self._stem(integrator, gbuffer.camera, [self.time], samples, settings)
        return self.cache.tensors(stem, make)

    def pictures(
        self,
        settings: Settings = NONE,
        *,
        time: float | None = None,
        seeds: tuple[int, int] = (1, 2),
        name: str = "radiance",
    ) -> tuple[Tensor, Tensor]:
        """Two independent halves of a `picture`, by half of the paths each."""
        given: dict[str, Any] = {"time": time, "samples": max(self.samples // 2, 1), "name": name}
        first, second = (self.picture({**settings, "seed": seed}, **given) for seed in seeds)
        return first, second

    def picture(
        self,
        settings: Settings = NONE,
        *,
        time: float | None = None,
        samples: int | None = None,
        name: str = "radiance",
    ) -> Tensor:
        """``(1, 3, H, W)`` of the path-traced frame; while a ``shutter`` is open the camera moves."""
        from tracer.truth import truth

        seconds = self.time if time is None else time
        count = self.samples if samples is None else samples
        moves = settings.get("shutter", 0.0) > 0
        ends = [seconds - 1 / self.fps, seconds, seconds + 1 / self.fps] if moves else [seconds]
        camera: Any = self.camera if moves else self.camera(seconds)

        def make() -> Truth:
            found = truth.path_trace(
                self.scene, camera, time=seconds, samples=count, progress=self._counted("path_trace"), **settings
            )
            return _flat(found)

        stem = self._stem("path_trace", [self.camera(t) for t in ends], ends, count, settings)
        return self.cache.tensors(stem, make)[name]

    def kept(self, kind: str, cameras: Any, times: list[float], settings: Any, make: Callable[[], Truth]) -> Truth:
        """Tensors of a subject's own, kept under a name made from all that they depend on."""
        return self.cache.tensors(self._stem(kind, cameras, times, settings), make)

    def _counted(self, integrator: str) -> Callable[[int, int], None]:
        what = integrator.replace("_", " ")
        return lambda done, of: self.say(f"{self.view}, truth by {what}, {done} of {of} samples")

    def _stem(self, kind: str, cameras: Any, times: list[float], *settings: Any) -> str:
        poses = self.scene.poses(times)
        return f"{kind}_{digest(kind, self.contents, poses, times, cameras, settings, sources(*TRACED_BY))}"


def _joined(first: Truth, second: Truth) -> dict[str, Tensor]:
    """Means of two halves, and the halves."""
    mean = {name: (value + second[name]) / (2 if value.ndim else 2 * 2**0.5) for name, value in first.items()}
    if "bent_normal" in mean:
        bent = first["ao"] * first["bent_normal"] + second["ao"] * second["bent_normal"]
        mean["bent_normal"] = bent / bent.norm(dim=1, keepdim=True).clamp_min(1e-6)
    halves = {"first": first, "second": second}
    return mean | {f"{name}_{which}": t for which, half in halves.items() for name, t in half.items() if t.ndim}


def _flat(found: Any) -> dict[str, Tensor]:
    """Values of a truth, and the mean standard error of each as ``<name>_error``."""
    errors = {f"{name}_error": torch.as_tensor(float(error.mean())) for name, error in found.error.items()}
    return {**found.values, **errors}
