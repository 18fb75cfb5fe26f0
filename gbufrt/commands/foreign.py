"""Frames of other renderers for `gbufrt post`: their numbers, cameras and missing channels, and which passes fit."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import torch

from gbufrt.commands.session import Recipe
from gbufrt.files.gbuffers.agreement import disagreements
from gbufrt.files.gbuffers.cameras import Cameras, load_cameras
from gbufrt.files.gbuffers.detect import detect
from gbufrt.files.gbuffers.profile import SHIPPED
from gbufrt.files.gbuffers.read import read_gbuffer
from gbufrt.files.guard import read_parts
from gbufrt.frame import Frame
from gbufrt.names import unknown
from gbufrt.pipeline import Pipeline
from post import Denoise, EstimateMissing, normals_from_depth

LIT = ("ao", "gi", "reflection", "behind", "composite")
"""Stages that make light of direct light; a finished picture holds it already."""
DISPLAY = ("exposure", "tone_map", "encode")
ESTIMATED = ("motion", "motion_z", "thickness")
GUESSED = ("roughness", "metallic")
SHORT = {"dof": "depth_of_field"}


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where the files of another renderer come from.

    Args:
        paths: in order.
        profile: ``auto``, a shipped profile, or a TOML file.
        cameras: of the frames; None with ``fov``.
        fov: vertical field of view in degrees of a camera that stands still.
    """

    paths: list[Path]
    profile: str
    cameras: Cameras | None
    fov: float | None
    _told: set[str] = field(default_factory=set)

    @staticmethod
    def named(paths: list[Path], profile: str, camera: Path | None, fov: float | None) -> Source:
        """The source that the command line names.

        Raises:
            ValueError: a profile or camera is missing or wrong.
            FileNotFoundError: there is no such camera file.
        """
        if (camera is None) == (fov is None):
            raise ValueError(
                "--from needs the camera: give --camera FILE.toml, or --fov DEGREES for one that stands still"
            )
        if fov is not None and not 0 < fov < 180:
            raise ValueError(f"--fov must lie between 0 and 180 degrees, got {fov:g}")
        if profile not in ("auto", *SHIPPED) and not Path(profile).is_file():
            raise ValueError(unknown("profile", profile, "--from", ("auto", *SHIPPED)) + ", or give a .toml file")
        return Source(paths=paths, profile=profile, cameras=None if camera is None else load_cameras(camera), fov=fov)

    @staticmethod
    def of(paths: list[Path], profile: str, camera: Path | None, fov: float | None) -> Source:
        """Files in order; says what they are taken for.

        Raises:
            ValueError: see `named`; a file fits no profile, or numbers run backwards.
            FileNotFoundError: see `named`.
        """
        source = Source.named(paths, profile, camera, fov)
        numbers = source.numbers
        if numbers != sorted(set(numbers)):
            raise ValueError("frame numbers in the files' names must count up; give the files in order")
        if profile == "auto":
            found = detect(paths[0])
            source.tell(f"{paths[0]}: {found.name} ({found.certainty:.0%} sure: {'; '.join(found.reasons[:3])})")
        if fov is not None:
            source.tell("--fov: the camera is taken to stand still; moving ones need --camera")
        gaps = [n for n, after in pairwise(numbers) if after != n + 1]
        if gaps:
            source.tell(f"no frame {gaps[0] + 1}: histories begin anew after a gap")
        return source

    @property
    def numbers(self) -> list[int]:
        """The last number in each file's name; the place in the list where one has none."""
        found = [re.findall(r"\d+", path.stem) for path in self.paths]
        return [int(digits[-1]) for digits in found] if all(found) else list(range(len(self.paths)))

    def tell(self, line: str) -> None:
        """Say something once, on stderr."""
        if line not in self._told:
            self._told.add(line)
            print(f"gbufrt: {line}", file=sys.stderr)

    def frames(self) -> Iterator[Frame]:
        """The frames of all files, in order."""
        before = None
        for path in self.paths:
            before = self.frame(path, before)
            yield before

    def frame(self, path: Path, before: Frame | None = None) -> Frame:
        """The frame of one of the files, ready for the passes; ``before`` is the one before it, if there is one."""
        frame, wrong = self.read(path, before)
        for line in wrong:
            self.tell(f"{path}: {line}")
        guessed = frame.extra.get("normal_estimated")
        if guessed is not None:
            g = frame.gbuffer
            normal = torch.where(guessed > 0, normals_from_depth(g.depth, g.camera, hit=g.hit), g.normal)
            frame = frame.replace(gbuffer=g.replace(normal=normal))
        if frame.radiance is None:
            if frame.composite is None:
                raise ValueError(f"{path} holds no light: neither passes of direct light nor a finished picture")
            frame = frame.replace(color=frame.composite)
        return frame

    def read(self, path: Path, before: Frame | None = None) -> tuple[Frame, list[str]]:
        """The frame of one of the files, and what of it disagrees; ``before`` is used where it is the one before."""
        number = self.numbers[self.paths.index(path)]
        known: dict[str, Any] = {"fov": self.fov}
        follows = before is not None and before.index == number - 1
        if self.cameras is not None:
            size = read_parts(path, header_only=True)[0].size
            known = {"camera": self.cameras.at(number, size)}
            if follows or number - 1 in self.cameras.tables:
                known["previous_camera"] = self.cameras.at(number - 1, size)
        frame = read_gbuffer(path, self.profile, index=number, **known)
        if follows and self.cameras is None:
            g = frame.gbuffer
            frame = frame.replace(gbuffer=g.replace(previous_camera=g.camera))
        return frame, disagreements(frame, before if follows else None)


def pipeline_for(frame: Frame, recipe: Recipe, wanted: Iterable[str]) -> Pipeline:
    """The passes that fit a frame of another renderer.

    Direct light goes through all of them. Motion and thickness that the G-buffer lacks are estimated first; roughness
    and metalness, whose estimates are worse than none, only for reflections that are asked for. A finished picture has
    its indirect light, shadows and reflections: none is added again. Ambient occlusion may be asked for as a layer,
    which leaves the picture as it is.

    Args:
        frame: the first one.
        recipe: of the command line.
        wanted: stages to keep beside those of the display, and ``denoise``; by default all that fit.

    Raises:
        ValueError: no such stage, or one that adds light to a finished picture.
    """
    finished = frame.radiance is None
    stages = dict(recipe.build().stages.items())
    names = [SHORT.get(name, name) for name in wanted]
    for name in names:
        if name not in (*stages, "denoise"):
            raise ValueError(unknown("stage", name, "--passes", (*stages, "denoise")))
        if finished and name in LIT and name != "ao":
            raise ValueError(
                f"--passes {name} would add light that the finished picture holds already; render the passes of direct "
                "light too"
            )
    left_out = set(LIT) - set(names) if finished else set()
    if not finished and not names and frame.gbuffer.roughness is None:
        left_out.add("reflection")
        warnings.warn(
            "the files hold no roughness, so that reflections are left out; --passes reflection,ao,gi,... guesses it",
            stacklevel=2,
        )
    if names:
        always = {"denoise", "missing", *DISPLAY, *(() if finished else ("composite",))}
        left_out |= set(stages) - set(names) - always
    kept = {name: stage for name, stage in stages.items() if name not in left_out}
    light = "color" if finished else "radiance"
    guessed = GUESSED if "reflection" in kept and frame.gbuffer.roughness is None else ()
    first: dict[str, Any] = {"missing": EstimateMissing(channels=(*ESTIMATED, *guessed))}
    if "denoise" in names:
        first["denoise"] = Denoise(signal=light)
    return Pipeline(given={"color"} if finished else (), **first, **kept)  # pyright: ignore[reportArgumentType]
