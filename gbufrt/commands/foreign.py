"""Frames of other renderers for `gbufrt post`: their numbers, cameras and missing channels."""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import torch

from gbufrt.camera import Camera
from gbufrt.commands.fitting import LIT
from gbufrt.files.gbuffers.agreement import disagreements
from gbufrt.files.gbuffers.cameras import Cameras, load_cameras
from gbufrt.files.gbuffers.carried import carried_camera
from gbufrt.files.gbuffers.cuts import cut_between, cut_off
from gbufrt.files.gbuffers.detect import better, detect, is_frame, named_by
from gbufrt.files.gbuffers.grain import lamps_told
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.light import explained
from gbufrt.files.gbuffers.motion import fitted
from gbufrt.files.gbuffers.profile import CHANNELS, SHIPPED, Profile, load_profile
from gbufrt.files.gbuffers.read import read_gbuffer
from gbufrt.files.gbuffers.sequence import Shot, numbered, one_shot, shot_parts, shots_of
from gbufrt.files.gbuffers.settle import found_settings, settled
from gbufrt.frame import Frame
from gbufrt.names import unknown
from post import normals_from_depth

SHARES = re.compile(r"\d+%|bend by \S+|instead of \S+")  # of a disagreement, which differ from frame to frame


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where the files of another renderer come from.

    Args:
        shots: the frames, in order.
        profile: ``auto``, a shipped profile, or a TOML file.
        cameras: of the frames; None with ``fov``, or where the files carry theirs.
        fov: vertical field of view in degrees of a camera that stands still.
        whole: see `read_gbuffer`.
        layer: that of the profile, if it is to be another.
    """

    shots: list[Shot]
    profile: str
    cameras: Cameras | None
    fov: float | None
    whole: bool = False
    layer: str = ""
    _told: set[str] = field(default_factory=set)
    _held: set[str] = field(default_factory=set)
    _lost: set[str] = field(default_factory=set)
    _profiles: dict[str, Profile] = field(default_factory=dict)

    @staticmethod
    def named(paths: list[Path], profile: str, camera: Path | None, fov: float | None, layer: str = "") -> Source:
        """The source that the command line names.

        Raises:
            ValueError: a profile or camera is missing or wrong.
            FileNotFoundError: there is no such camera file.
        """
        if camera is not None and fov is not None:
            raise ValueError("--camera and --fov exclude each other; leave one out")
        if fov is not None and not 0 < fov < 180:
            raise ValueError(f"--fov must lie between 0 and 180 degrees, got {fov:g}")
        if profile not in ("auto", *SHIPPED) and not Path(profile).is_file():
            raise ValueError(unknown("profile", profile, "--from", ("auto", *SHIPPED)) + ", or give a .toml file")
        cameras = None if camera is None else load_cameras(camera)
        shots = shots_of(paths)
        if len(shots) > 1 and not any(map(numbered, paths)) and not is_frame(paths[0], profile):
            shots = [one_shot(paths)]
        return Source(shots=shots, profile=profile, cameras=cameras, fov=fov, layer=layer)

    @staticmethod
    def of(
        paths: list[Path],
        profile: str,
        camera: Path | None,
        fov: float | None,
        passes: Collection[str] = (),
        layer: str = "",
    ) -> Source:
        """Files in order; says what they are taken for.

        Where ``passes`` are chosen and none of them makes light, they work on the finished picture, if there is one.

        Raises:
            ValueError: see `named`; a file fits no profile, numbers run backwards, or there is no camera.
            FileNotFoundError: see `named`.
        """
        whole = bool(passes) and not {*passes} & {*LIT}
        source = replace(Source.named(paths, profile, camera, fov, layer), whole=whole)
        numbers = [shot.number for shot in source.shots]
        for shot in source.shots:
            if source.are_frames(shot):
                a, b = shot.files[:2]
                raise ValueError(
                    f"{a} and {b} have one frame number, but are no passes of one frame: each has depth and more; run "
                    "them apart, such as left and right eyes"
                )
        for before, after in pairwise(source.shots):
            if after.number < before.number:
                raise ValueError(
                    f"frame numbers in the files' names must count up, but {after} comes after {before}; give the "
                    "files in order, and those of other shots or programs apart"
                )
        first = source.shots[0]
        if profile == "auto":
            found = detect(first.files)
            source.tell(f"{first}: {found.name} ({found.certainty:.0%} sure: {'; '.join(found.reasons[:3])})")
        else:
            layers = Layers(first.files[0], shot_parts(first.files, header_only=True))
            named_by(layers, load_profile(profile))
            if (other := better(layers, profile)) is not None:
                source.tell(f"{first}: --from {profile}, but {other.name} fits ({other.reasons[0]})")
        if fov is not None:
            source.tell("--fov: the camera is taken to stand still; moving ones need --camera")
        elif camera is None and source.carried(first) is None:
            raise ValueError(
                f"{first} carries no camera: give --camera FILE.toml, or --fov DEGREES for one that stands still"
            )
        gaps = [n for n, after in pairwise(numbers) if after != n + 1]
        if gaps:
            source.tell(f"no frame {gaps[0] + 1}: histories begin anew after a gap")
        return source

    def are_frames(self, shot: Shot) -> bool:
        """Whether several files of one number are frames of their own, because the first has depth and more."""
        return len(shot.files) > 1 and is_frame(shot.files[0], self.profile)

    def carried(self, shot: Shot) -> Camera | None:
        """The camera in a frame's files."""
        profile = load_profile(self.profile_of(shot))
        layers = Layers(shot.files[0], shot_parts(shot.files, header_only=True))
        return carried_camera(layers.header, profile, layers.size)

    def profile_of(self, shot: Shot) -> str:
        """The profile's name or path."""
        return detect(shot.files).name if self.profile == "auto" else self.profile

    def tell(self, line: str, kind: str = "") -> None:
        """Say something once, on stderr; of lines of a ``kind`` the first."""
        if (kind or line) not in self._told:
            self._told.add(kind or line)
            print(f"gbufrt: {line}", file=sys.stderr)

    def frames(self) -> Iterator[Frame]:
        """The frames of all files, in order.

        Raises:
            ValueError: a file cannot be read, or some have passes of direct light and others a finished picture alone.
        """
        before = None
        for shot in self.shots:
            frame = self.frame(shot, before)
            if before is not None and (frame.radiance is None) != (before.radiance is None):
                alone, lit = (shot, self.shots[0]) if frame.radiance is None else (self.shots[0], shot)
                raise ValueError(f"{alone} has a finished picture alone, {lit} direct light too; run them apart")
            before = frame
            yield frame

    def frame(self, shot: Shot, before: Frame | None = None) -> Frame:
        """One of the frames, ready for the passes; ``before`` is the one before it, if there is one."""
        frame, wrong = self.read(shot, before)
        for line in wrong:
            self.tell(f"{shot}: {line}", SHARES.sub("", line))  # all frames are wrong in one way
        if lamps := lamps_told(frame):
            self.tell(lamps)
        guessed, g = frame.extra.get("normal_estimated"), frame.gbuffer
        if guessed is not None and min(g.camera.size) > 1:
            g = g.replace(normal=torch.where(guessed > 0, normals_from_depth(g.depth, g.camera, hit=g.hit), g.normal))
        if frame.radiance is None:
            if frame.composite is None:
                raise ValueError(f"{shot} holds no light: neither passes of direct light nor a finished picture")
            albedo = None if g.albedo is None else explained(g.albedo, frame.composite, g.hit)
            frame, g = frame.replace(color=frame.composite), g.replace(albedo=albedo)
        return frame.replace(gbuffer=g)

    def read(self, shot: Shot, before: Frame | None = None) -> tuple[Frame, list[str]]:
        """One of the frames, and what of it disagrees; ``before`` is used where it is the one before."""
        number, known = shot.number, dict[str, Any]()
        cut = self.cameras is not None and self.cameras.cuts_at(number)
        follows = before is not None and before.index == number - 1 and not cut
        if self.fov is not None:
            known["fov"] = self.fov
        elif self.cameras is not None:
            part = shot_parts(shot.files, header_only=True)[0]
            picture = part.whole, part.pixel_aspect
            known["camera"] = self.cameras.at(number, *picture)
            if not cut and (follows or number - 1 in self.cameras.tables):
                known["previous_camera"] = self.cameras.at(number - 1, *picture)
        elif follows and before is not None:
            known["previous_camera"] = before.gbuffer.camera
        frame = read_gbuffer(shot.files, self.read_by(shot), index=number, whole=self.whole, **known)
        profile = self._keep(shot, frame)
        self._tell_lost(shot, profile)
        if follows and self.fov is not None:
            g = frame.gbuffer
            frame = frame.replace(gbuffer=g.replace(previous_camera=g.camera))
        before = before if follows else None
        if before is not None and self.fov is None and (why := cut_between(before, frame)):
            self.tell(f"{shot}: {why}: taken for a cut, histories begin anew")
            cut, before = True, None
        frame = cut_off(frame) if cut else frame
        return frame, disagreements(frame, before, profile=profile, posed=self.fov is None)

    def _tell_lost(self, shot: Shot, profile: Profile) -> None:
        """Say once of each channel that a frame lacks it where others before have it."""
        named = named_by(Layers(shot.files[0], shot_parts(shot.files, header_only=True)), profile)
        there = {channel for channel in CHANNELS if named.keys(channel)}
        if lost := [channel for channel in CHANNELS if channel in self._held - there]:
            self.tell(f"frame {shot.number} ({shot}) lacks {', '.join(lost)}, which frames before have")
        self._held.difference_update(lost)
        self._held.update(there - self._lost)
        self._lost.update(lost)

    def read_by(self, shot: Shot) -> Profile:
        """The profile of a shot, as the first frame that it fits has settled it."""
        name = self.profile_of(shot)
        profile = self._profiles.get(name) or load_profile(name)
        return replace(profile, layer=self.layer or profile.layer)

    def _keep(self, shot: Shot, frame: Frame) -> Profile:
        """Let all frames have the settings that the pixels of the first one tell; says what they are.

        Motion is told by the first frame whose camera moves, so that it is read alike where it stands again.
        """
        name, profile, g = self.profile_of(shot), self.read_by(shot), frame.gbuffer
        if name not in self._profiles and profile.is_open:
            named = named_by(Layers(shot.files[0], shot_parts(shot.files)), profile)
            self._profiles[name] = settled(named, g.camera, posed=self.fov is None).profile
            if found := found_settings(profile, self._profiles[name]):
                self.tell(f"{shot}: by its pixels {found}")
        kept, before = self._profiles.setdefault(name, profile), g.previous_camera
        if (
            kept.motion_fitted
            and before is not None
            and not torch.equal(before.world_from_view, g.camera.world_from_view)
        ):
            named = named_by(Layers(shot.files[0], shot_parts(shot.files)), kept)
            self._profiles[name] = fitted(named, g.camera, before, g.depth, g.hit) or kept
        return self._profiles[name]
