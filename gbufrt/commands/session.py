"""What render and post share: in what order frames go through a pipeline, and where results go."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from gbufrt.camera import Camera
from gbufrt.commands.arguments.checks import check_name
from gbufrt.commands.arguments.options import FileOptions
from gbufrt.commands.arguments.values import check_device, parse_names
from gbufrt.commands.progress import Tick
from gbufrt.files.color_maps import to_srgb
from gbufrt.files.exr import best_picture, read_exr, write_exr
from gbufrt.files.png import to_pil, write_png
from gbufrt.files.precision import Precision
from gbufrt.files.views import debug_names, debug_view, layers_sheet, sheet_of
from gbufrt.frame import LIGHT, SIGNALS, Frame
from gbufrt.gbuffer import CHANNELS
from gbufrt.history import PipelineState
from gbufrt.noise.noise import dithered
from gbufrt.pipeline import Pipeline


class Runner:
    """Sends frames through a pipeline in order.

    A frame that does not follow the one before it starts a new history with `Pipeline.settle`: the passes run over it
    ``warmup`` times before it counts, unless `settle` has begun a history for it.
    """

    def __init__(self, pipeline: Pipeline, warmup: int) -> None:
        self.pipeline, self.warmup = pipeline, warmup
        self.state: PipelineState | None = None
        self.settled: PipelineState | None = None
        self.last: tuple[int, Camera] | None = None  # all of a frame would be in memory beside the next

    def settle(self, stills: Iterable[Frame], tick: Tick = lambda: None) -> None:
        """Begin the history of the next frame with what a camera saw that stood where the frame's stands, before it.

        Args:
            stills: in place of the warm-up over the frame itself; where there are none, that stays.
            tick: called after each run of the pipeline.
        """
        with torch.no_grad():
            for still in stills:
                _, self.settled = self.pipeline(still, self.settled)
                tick()

    def __call__(self, frame: Frame, tick: Tick = lambda: None) -> Frame:
        """The frame after all passes.

        Args:
            frame: what to run them over.
            tick: called after each run of the pipeline.
        """
        with torch.no_grad():
            if self.settled is not None:
                before, self.settled = self.settled, None
                result, self.state = self.pipeline(frame.still(), before)
                result = result.moving_as(frame)
                tick()
            elif self.last is not None and _follows(*self.last, frame):
                given, self.state = None if self.state is None else self.state.handed_over(), None
                result, self.state = self.pipeline(frame, given)
                tick()
            else:
                result, self.state = self.pipeline.settle(frame, self.warmup + 1, tick=tick)
        self.last = int(frame.index), frame.gbuffer.camera
        return result

    def runs(self, frames: int, cuts: int = 0) -> int:
        """How many runs of the pipeline consecutive frames take, with as many ``cuts`` among them."""
        return frames + self.warmup * (1 + cuts)


def bare(frame: Frame) -> Frame:
    """The frame without anything that a pass wrote: G-buffer, light, and the same of what lies behind."""
    ways = frame.reflection_distance if frame.specular is not None else None  # of the tracer's specular rays
    return Frame(
        gbuffer=frame.gbuffer,
        reflection_distance=ways,
        index=frame.index,
        time=frame.time,
        cut=frame.cut,
        emitters_sampled=frame.emitters_sampled,
        emitters_mirrored=frame.emitters_mirrored,
        behind=None if frame.behind is None else bare(frame.behind),
        **{name: frame.get(name) for name in LIGHT},  # pyright: ignore[reportArgumentType]
    )


def own(paths: Iterable[Path]) -> Iterator[Frame]:
    """The frames of files that `gbufrt render` wrote, as they were before the passes; says where one is missing."""
    expected = None
    for path in paths:
        frame = bare(read_exr(path))
        if expected is not None and int(frame.index) > expected:
            print(f"gbufrt: no frame {expected} before {path}: histories begin anew after a gap", file=sys.stderr)
        expected = int(frame.index) + 1
        yield frame


def precision_of(files: FileOptions, notes: Mapping[str, Any] | None = None) -> Precision:
    """The precision that is asked for, or else that of a file with these ``notes``, or else half."""
    found = (notes or {}).get("files")
    stored = found.get("precision") if isinstance(found, dict) else None
    return files.precision or ("float" if stored == "float" else "half")  # pyright: ignore[reportReturnType]


def check_only(files: FileOptions, pipeline: Pipeline) -> None:
    """Raise ValueError where --only names what neither frames nor passes have."""
    known = {*CHANNELS, *SIGNALS, "behind"}.union(*(stage.writes for _, stage in pipeline.passes()))
    for name in parse_names(files.only):
        check_name("--only", name.removeprefix("behind."), sorted(known))


def save(folder: Path, stem: str, frame: Frame, *, notes: Mapping[str, Any], debug: bool, files: FileOptions) -> None:
    """Write a finished frame: pictures first and the EXR last, so that an EXR stands for a frame that is done."""
    picture = frame.image if frame.image is not None else to_srgb(best_picture(frame))
    if files.bits == 8 and not (frame.image is not None and is_dithered(notes)):
        picture = dithered(picture, index=frame.index)
    if debug:
        views = {name: to_pil(debug_view(frame, name)) for name in debug_names(frame)}
        views |= {"sheet": sheet_of(views)} | ({} if frame.behind is None else {"layers": layers_sheet(frame)})
        for name, view in views.items():
            write_png(folder / "debug" / f"{stem}_{name}.png", view)
    write_png(folder / f"{stem}.png", picture, bits=files.bits)
    write_exr(
        folder / f"{stem}.exr",
        frame,
        notes={**notes, "files": {"precision": precision_of(files)}},
        precision=precision_of(files),
        compression=files.compression,  # pyright: ignore[reportArgumentType]
        only=parse_names(files.only),
    )


def is_dithered(notes: Mapping[str, Any]) -> bool:
    """Whether the pipeline of a frame with these ``notes`` has dithered its image: twice would be noisier."""
    settings = notes.get("pipeline", {}).get("set", {})
    return any(name.rpartition(".")[2] == "dither" and value is True for name, value in settings.items())


def encode(files: FileOptions, pictures: Sequence[Path], fps: float) -> None:
    """Make the video that is asked for, of the pictures in order, and tell."""
    if files.video is not None:
        from gbufrt.files.video import write_video

        write_video(files.video, pictures, fps=fps)
        print(f"wrote {len(pictures)} frame{'s' * (len(pictures) > 1)} at {fps:g} a second to {files.video}")


def open_device(name: str) -> torch.device:
    """The device called ``name``.

    Raises:
        ValueError: there is none.
    """
    check_device(name)
    kind, _, number = name.partition(":")
    if kind == "cuda" and int(number or 0) >= torch.cuda.device_count():
        raise ValueError(f"--device {name}: there is no such CUDA device here; use --device cpu")
    return torch.device(name)


def _follows(index: int, camera: Camera, frame: Frame) -> bool:
    """Whether a frame is the next one after that of an index and a camera."""
    before = frame.gbuffer.previous_camera
    if before is None or frame.index != index + 1 or (frame.cut is not None and bool(frame.cut.any())):
        return False
    return _same_pose(before, camera)


def _same_pose(a: Camera, b: Camera) -> bool:
    if (a.size, a.orthographic, a.batch) != (b.size, b.orthographic, b.batch):
        return False
    return torch.equal(a.world_from_view, b.world_from_view) and torch.equal(a.intrinsics, b.intrinsics)
