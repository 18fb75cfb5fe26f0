"""`gbufrt render`: from a world to finished frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from gbufrt.commands.arguments.checks import check_cluster, check_files, check_folder, check_options
from gbufrt.commands.arguments.options import ClusterOptions, FileOptions, PassOptions
from gbufrt.commands.arguments.values import MOST_FRAMES, Flag, Whole, at_least, parse_names, parse_size
from gbufrt.commands.arguments.world import DayOptions, FogOptions, PartOptions
from gbufrt.commands.flights.flight import Flight, shoot, stem
from gbufrt.commands.flights.job import Job
from gbufrt.commands.flights.sampling import sampling_of
from gbufrt.commands.flights.shots import LEAD_IN, Shot, cut
from gbufrt.commands.flights.standpoint import Standpoint

if TYPE_CHECKING:
    from gbufrt.commands.session import Runner
    from gbufrt.frame import Frame

SEED = (
    "Seed of the built-in worlds: another one, another world. Noise comes from the frame's number; passes have seeds "
    "of their own, as --set ao.estimate.seed=1."
)


def render(
    world: str = "builtin",
    *,
    out: Path = Path("out"),
    view: str | None = None,
    eye: str | None = None,
    target: str | None = None,
    fov: float | None = None,
    camera: Path | None = None,
    frames: Whole | None = None,
    size: str = "960x540",
    time: float = 0.0,
    fps: float = 24.0,
    light_samples: Whole | None = None,
    seed: Annotated[Whole | None, Parameter(help=SEED)] = None,
    resume: Flag = False,
    lead_in: Whole | None = None,
    part: PartOptions | None = None,
    day: DayOptions | None = None,
    fog: FogOptions | None = None,
    options: PassOptions | None = None,
    files: FileOptions | None = None,
    spread: ClusterOptions | None = None,
) -> None:
    """Trace a world into G-buffers, run the passes over them, and write OUT/frame_0000.png and .exr for every frame.

    The EXR holds every channel and signal, so that `gbufrt post` can run other passes over it later; or, with --only,
    some. The first frame has no history: the passes run over it several times, as if it stood still (see --warmup).

    Args:
        world: Built-in world (builtin, terrain, ...), .vox or .mca file, Minecraft save folder, .schem,
            .schematic, .litematic or .nbt file.
        out: Folder to write to; made where it is missing.
        view: Named view or camera path of the world; by default its first, by night the first above water.
        eye: In place of --view: where the camera is, as X,Y,Z in world units (voxels), y up. A negative number needs an
            equals sign: --eye=-12,30,8.
        target: Where it looks to, likewise.
        fov: Vertical field of view, degrees. [default: the view's, or 60]
        camera: In place of all of these: a file of cameras in TOML, one or one a frame, as for `gbufrt post`.
        frames: How many frames. [default: one, or as many as the file of cameras has]
        size: Width x height in pixels.
        time: Seconds into the scene at the first frame.
        fps: Frames a second of the scene's time.
        light_samples: Shadow rays to each light per pixel; more is smoother and slower.
        resume: Make the frames that OUT lacks. Finished frames before them are read again to restore the history. On a
            cluster those of the same shot are traced again instead, and where shots begin depends on --workers.
        lead_in: With --cluster each worker makes a shot of consecutive frames, and begins so many frames early to fill
            histories; with fewer, seams show. [default: 64]
    """
    options, files, spread = options or PassOptions(), files or FileOptions(), spread or ClusterOptions()
    standpoint = Standpoint.of(view, eye, target, fov, camera)
    frames = standpoint.frames if frames is None else frames
    job = Job(
        world=world,
        standpoint=standpoint,
        size=parse_size(size),
        frames=frames,
        time=time,
        fps=fps,
        samples=light_samples,
        seed=seed,
        part=part or PartOptions(),
        day=day or DayOptions(),
        fog=fog or FogOptions(),
    )
    job.check()
    if lead_in is not None:
        at_least("--lead-in", lead_in, 0, MOST_FRAMES)
    check_options(options)
    check_files(files, resume=resume)
    check_folder(out / "debug" if options.debug else out)
    check_cluster(spread, device=options.device, lead_in=lead_in)

    from gbufrt.commands.ahead import compile_ahead
    from gbufrt.commands.recipe import Recipe
    from gbufrt.commands.session import Runner, check_only, encode, open_device, precision_of
    from gbufrt.commands.trial import check_overlays, tried

    recipe = replace(Recipe.of(options), fog=job.fog.parsed() is not None)
    device = open_device(options.device)
    runner = Runner(tried(recipe, device), recipe.warmup)
    check_only(files, runner.pipeline)
    sampling = sampling_of(runner, recipe, frames)
    check_overlays(runner.pipeline, sampling.rendered(job.size))
    kernels_are_ready = compile_ahead(recipe, runner.pipeline, options.device)
    scene = job.load().to(device)
    early = LEAD_IN if lead_in is None else lead_in
    shots = {} if spread.cluster is None else {"shots": {"lead_in": early}}
    notes = {"render": job.notes(), "pipeline": recipe.to_notes(), "files": {"precision": precision_of(files)}, **shots}
    missing = unfinished(out, frames, notes, jitter=sampling.jitter > 0) if resume else list(range(frames))
    pictures = [out / f"{stem(index)}.png" for index in range(frames)]
    if not missing:
        print(f"all {frames} frames are in {out} already")
        encode(files, pictures, fps)
        return
    flight = Flight(
        job=job, scene=scene, recipe=recipe, sampling=sampling, notes=notes, debug=options.debug, files=files
    )
    if spread.cluster is None:
        _in_one_go(flight, missing, runner, out, device, kernels_are_ready)
    else:
        kernels_are_ready()  # workers would compile them all at once
        _in_shots(flight, missing, out, spread, early)
    _tell(out, missing, recipe.warmup, parse_names(files.only))
    encode(files, pictures, fps)


def _in_one_go(flight: Flight, missing: list[int], runner: Runner, out: Path, device: Any, ready: Any) -> None:
    """Make and write the missing frames here, in order; those that are there are read, for the history."""
    from gbufrt.commands.progress import progress
    from gbufrt.commands.session import bare

    anew, shot = set(missing), Shot(begin=0, wanted=tuple(missing))
    cuts = sum(map(flight.job.standpoint.cuts_at, shot.frames))
    with progress("render", len(missing) + runner.runs(len(shot.frames), cuts)) as doing:
        known = lambda index: bare(_read(out, index)).to(device)
        for index, frame in flight.make(shot, runner, device=device, doing=doing, known=known, ready=ready):
            if index in anew:
                flight.save(out, index, frame)


def _in_shots(flight: Flight, missing: list[int], out: Path, spread: ClusterOptions, lead_in: int) -> None:
    """Make and write the missing frames on the workers of a cluster."""
    from gbufrt.commands.cluster.connection import open_cluster
    from gbufrt.commands.progress import progress

    with open_cluster(spread) as cluster:
        shots = cut(flight.job.frames, missing, workers=cluster.workers, lead_in=lead_in)
        with progress("render", sum(len(shot.frames) for shot in shots)) as doing:
            for what in cluster.run(shoot, shots, shared=flight, out=out):
                doing(what)()
    count = f"{len(shots)} shots" if len(shots) > 1 else "one shot: the flight is too short for more"
    print(f"{count}, {min(len(shots), cluster.workers)} at once, {cluster.threads(len(shots))} threads each")


def _tell(out: Path, made: list[int], warmup: int, only: tuple[str, ...]) -> None:
    """Say what has been written; ``only`` what is all that the EXRs hold, where it is not everything."""
    if warmup and made[0] == 0:
        times = "once" if warmup == 1 else f"{warmup} times"
        print(f"the passes ran {times} over frame 0, standing still, before it counted (--warmup)")
    first, last = out / stem(made[0]), stem(made[-1])
    if len(made) > 1:
        print(f"wrote {len(made)} frames to {out} ({first.name}.png and .exr to {last}.png and .exr)")
    else:
        held = f"{', '.join(only)} alone" if only else "everything that led to it"
        print(f"wrote {first}.png, the picture, and {first}.exr, with {held}")


def unfinished(out: Path, frames: int, notes: dict[str, Any], *, jitter: bool) -> list[int]:
    """The frames not finished in ``out``; a finished one has a complete EXR, and its PNG beside it.

    Args:
        out: the folder.
        frames: how many there are to be.
        notes: what they must have been made with.
        jitter: whether their camera must be jittered.

    Raises:
        ValueError: a frame there was made with other options, so that the rest would not fit it.
    """
    from gbufrt.files.exr import read_exr, read_notes

    missing = []
    for index in range(frames):
        path = out / f"{stem(index)}.exr"
        try:
            found = read_notes(path)
            frame = read_exr(path)
        except (FileNotFoundError, ValueError):  # not there, or damaged since: make it again
            missing.append(index)
            continue
        _check_fits(path, {"shots": notes.get("shots"), **found}, notes)  # what was made in one go fits any lead-in
        if (frame.gbuffer.camera.jitter is not None) != jitter:
            what = "a still, without the jitter of a sequence" if jitter else "part of a jittered sequence, not a still"
            raise ValueError(f"cannot resume: {path} is {what}; use another --out")
        size = frame.gbuffer.camera.size if frame.image is None else tuple(frame.image.shape[-2:])
        if not _is_picture(path.with_suffix(".png"), size):
            missing.append(index)
    return missing


def _check_fits(path: Path, found: dict[str, Any], notes: dict[str, Any]) -> None:
    for part, wanted in notes.items():
        stored = found.get(part)
        stored = stored if isinstance(stored, dict) else {}
        for key in {**wanted, **stored}:  # what only the file has was an option that is left out now
            there, value = stored.get(key), wanted.get(key)
            if there != value:
                raise ValueError(f"cannot resume: {path} has {key} {there!r}, not {value!r}; use another --out")


def _is_picture(path: Path, size: tuple[int, ...]) -> bool:
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.load()
            return picture.size == (size[1], size[0])
    except (OSError, ValueError, SyntaxError):  # not there, or damaged: Pillow raises SyntaxError for broken PNGs
        return False


def _read(out: Path, index: int) -> Frame:
    from gbufrt.files.exr import read_exr

    return read_exr(out / f"{stem(index)}.exr")
