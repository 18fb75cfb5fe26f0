"""`gbufrt post`: run passes over frames on disk."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from gbufrt.commands.arguments.checks import ENDINGS, check_files, check_folder, check_options
from gbufrt.commands.arguments.options import FileOptions, PassOptions
from gbufrt.commands.arguments.values import Flag, Without, parse_names
from gbufrt.commands.video import numbered

if TYPE_CHECKING:
    from gbufrt.commands.recipe import Recipe
    from gbufrt.frame import Frame


def post(
    *files: Path,
    out: Path = Path("out"),
    source: Annotated[str | None, Parameter(name="--from")] = None,
    camera: Path | None = None,
    fov: float | None = None,
    layer: str = "",
    environment: Path | None = None,
    passes: Without = (),
    strict: Flag = False,
    options: PassOptions | None = None,
    written: FileOptions | None = None,
) -> None:
    """Run the passes over EXR files, of `gbufrt render` or (--from) of other renderers.

    Of gbufrt's own files G-buffer and light alone are used. Without further options the pipeline is the one that they
    were rendered with, and the pictures are the same; --without and --set change it, --preset starts anew. Frames that
    follow each other share their history, others start with their own.

    Files of other renderers need a camera, unless they carry it. What their G-buffers lack is estimated. Passes of
    direct light get ambient occlusion, indirect light and reflections; to a finished picture no light is added. Files
    that share a frame number are passes of one frame.

    Light that is not finite, as in real renders, is mended (NaN becomes 0, infinity the largest value of its channel)
    and reported; geometry that is not finite is refused.

    Args:
        files: EXR files in order, such as shot.####.exr or shot.%04d.exr, or folders of them.
        out: Folder to write to; made where it is missing.
        source: What wrote the files: auto, blender, mitsuba, pbrt, falcor, unreal, nuke, houdini, arnold,
            renderman, generic, or a profile of your own in TOML. [default: gbufrt, or auto where it was another]
        camera: Of other renderers: the cameras, in TOML. [default: those that the files carry]
        fov: Of other renderers, in place of --camera: vertical field of view in degrees of a camera that stands still.
        layer: Of other renderers: the layer to take, such as Blender's view layers. [default: the one with most passes]
        environment: Of other renderers: the sky that mirrors show where they show nothing on screen, as an EXR with a
            lat-long picture of linear radiance (in the middle -z, or +y where z is up; in Blender's own +x). It lights
            nothing else. Light that holds the sky in mirrors already, as Blender's Glossy Direct does, needs none.
        passes: Of other renderers: passes to run, such as ao,gi,dof,motion_blur,denoise; by default all that fit.
            Exposure and tone curve always run.
        strict: Mend nothing: refuse a frame in which any channel breaks a convention.
    """
    options, written = options or PassOptions(), written or FileOptions()
    check_options(options)
    check_files(written)
    check_folder(out / "debug" if options.debug else out)
    paths = gathered(files, out)
    if source is None and (camera is not None or fov is not None or layer or passes or not is_own(paths[0])):
        source = "auto"
    if environment is not None and (source is None or fov is not None):
        why = "files of gbufrt carry their sky" if source is None else "with --fov nobody knows where the camera looks"
        raise ValueError(f"--environment is for files of other renderers with a camera, but {why}; leave it out")

    from gbufrt.commands.fitting import remedies
    from gbufrt.commands.progress import progress
    from gbufrt.commands.session import Runner, check_only, encode, open_device, own, precision_of, save
    from gbufrt.commands.trial import check_overlays, tried
    from gbufrt.demands.inputs import told_with
    from gbufrt.files.precision import as_stored

    device = open_device(options.device)
    size = one_size(paths)
    names = [path.stem for path in paths]
    if source is None:
        distinct(names)
        recipe, notes = recorded(paths, options)
        pipeline, frames = tried(recipe, device), own(paths)
        if recipe.pipeline != "me1" and options.warmup is None:
            recipe = replace(recipe, warmup=0)  # the same noise again would pass for light
    else:
        from gbufrt.commands.fitting import hint_of_units, pipeline_for
        from gbufrt.commands.foreign import Source
        from gbufrt.commands.recipe import Recipe
        from gbufrt.files.gbuffers.profile import load_profile
        from gbufrt.files.gbuffers.sky import read_environment, under

        wanted = parse_names(passes)
        origin = Source.of(paths, source, camera, fov, wanted, layer)
        paths, names = [shot.files[0] for shot in origin.shots], [shot.name for shot in origin.shots]
        distinct(names)
        recipe, notes = Recipe.of(options), {path: {} for path in paths}
        tried(recipe, device)
        frames = origin.frames()
        if environment is not None:
            profile = load_profile(origin.profile_of(origin.shots[0]))
            sky = read_environment(environment, turn=profile.environment_turn)
            frames = under(frames, sky, known=bool(profile.mirrors))
        first = next(frames)
        size = first.gbuffer.camera.size
        pipeline, frames = pipeline_for(first, recipe, wanted), chain([first], frames)
        if options.units_per_metre is None and (hint := hint_of_units(first, pipeline)):
            origin.tell(hint)
        if environment is not None and "reflection" not in pipeline.stages:
            raise ValueError("--environment is seen in reflections, which are left out; ask for them with --passes")
        if "denoise" in pipeline.stages:
            recipe = replace(recipe, warmup=0)  # the same noise again would pass for light
    check_overlays(pipeline, size)
    runner = Runner(pipeline, recipe.warmup)
    check_only(written, runner.pipeline)
    with_camera = "" if fov is None else "with --camera "
    sky = f"--environment SKY.exr {with_camera}gives it" if source is not None else "the files were written without it"
    with progress("post", runner.runs(len(paths))) as doing, told_with(remedies(sky=sky)):
        for path, name, frame in zip(paths, names, frames, strict=True):
            keeps = replace(written, precision=precision_of(written, notes[path]))
            frame = as_stored(sound(frame, path, strict=strict), precision_of(keeps))
            result = runner(frame.to(device), doing(f"passes of {name}"))
            told = {**notes[path], "pipeline": recipe.to_notes()}
            save(out, name, result, notes=told, debug=options.debug, files=keeps)
    print(f"wrote {len(paths)} frame{'s' if len(paths) > 1 else ''} to {out}")
    encode(written, [out / f"{name}.png" for name in names], rate_of(notes[paths[0]]))


def one_size(paths: list[Path]) -> tuple[int, int]:
    """``(H, W)`` of all files; reads headers only. Raises ValueError where one cannot be read or is of another size."""
    from gbufrt.files.guard import read_parts

    sizes = {path: read_parts(path, header_only=True)[0].whole for path in paths}
    for path, (height, width) in sizes.items():
        if (height, width) != sizes[paths[0]]:
            first = sizes[paths[0]]
            raise ValueError(
                f"{path} has {width}x{height} pixels, {paths[0]} {first[1]}x{first[0]}; run them apart, "
                "or save them at one size if they are passes of a frame"
            )
    return sizes[paths[0]]


def rate_of(notes: dict[str, Any]) -> float:
    """Frames a second that a file was rendered for; 24 where it does not say so."""
    rate = found.get("fps") if isinstance(found := notes.get("render"), dict) else None
    return float(rate) if isinstance(rate, (int, float)) and 1e-3 <= rate <= 1000 else 24.0


def gathered(files: tuple[Path, ...], out: Path) -> list[Path]:
    """The files to read, with folders and patterns replaced by what is in them.

    Raises:
        ValueError: there are none, a folder lacks one between others, or one would be written onto itself.
        FileNotFoundError: one does not exist.
    """
    from gbufrt.files.gbuffers.sequence import expanded

    paths: list[Path] = []
    for file in files:
        paths += within(file) if file.is_dir() else expanded(file)
    if not paths:
        raise ValueError("no files given; give EXR files or folders that `gbufrt render` wrote")
    for path in paths:
        if not path.exists():
            raise FileNotFoundError(f"{path} does not exist; check the path")
        if path.suffix.lower() in ENDINGS:
            raise ValueError(f"{path} is a world, which `gbufrt render {path}` shows; post takes EXR files")
        if path.parent.resolve() == out.resolve():
            raise ValueError(
                f"--out {out} is where {path.name} lies, which would be overwritten; choose another folder"
            )
    return paths


def distinct(names: list[str]) -> None:
    """Raises ValueError where two frames would be written to one name."""
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"several inputs are called {name}, and would be written to one file; run them apart")


def within(folder: Path) -> list[Path]:
    """The frames that `gbufrt render` wrote into a folder, or else all EXR files in it or in its folders, by number."""
    from gbufrt.files.gbuffers.sequence import exr_files

    files = exr_files(folder)
    if not files:
        raise ValueError(f"{folder} holds no EXR files; give files, or another folder")
    if any(re.fullmatch(r"frame_\d+\.exr", path.name) for path in files):
        return numbered(folder, "exr")
    return files


def is_own(path: Path) -> bool:
    """Whether gbufrt wrote a file; raises ValueError where it cannot be read."""
    from gbufrt.files.guard import read_parts
    from gbufrt.files.header import ATTRIBUTE

    return any(ATTRIBUTE in part.header for part in read_parts(path, header_only=True))


def sound(frame: Frame, path: Path, *, strict: bool = False) -> Frame:
    """The frame of ``path`` with finite light; what was mended is reported in one line on stderr.

    Raises:
        ValueError: the geometry is not finite; or ``strict`` and any channel breaks a convention.
    """
    from gbufrt.mending import mended

    try:
        if strict:
            frame.validate()
            return frame
        frame, report = mended(frame)
    except ValueError as error:
        hint = " (--strict mends nothing)" if strict else ""
        raise ValueError(f"{path}: {error}{hint}") from error
    if report:
        print(f"gbufrt: {path}: mended {'; '.join(map(str, report))}", file=sys.stderr)
    return frame


def recorded(paths: list[Path], options: PassOptions) -> tuple[Recipe, dict[Path, dict[str, Any]]]:
    """The pipeline to run, and each file's notes; reads headers only, so that a bad file is found before work starts.

    Raises:
        ValueError: a file cannot be read, or they were rendered with different pipelines and no preset is given.
    """
    from gbufrt.commands.recipe import Recipe
    from gbufrt.files.exr import read_notes

    notes = {path: read_notes(path) for path in paths}
    recipes = [Recipe.of_notes(note, source=str(path), warmup=options.warmup) for path, note in notes.items()]
    if options.preset is None and any(recipe != recipes[0] for recipe in recipes):
        raise ValueError("the files were rendered with different pipelines; say which to run with --preset")
    return Recipe.of(options, recipes[0]), notes
