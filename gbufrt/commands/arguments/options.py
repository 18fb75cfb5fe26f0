"""Options that the commands share: of passes, files and workers. Does not import torch, so that help is quick."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cyclopts import Parameter

from gbufrt.commands.arguments.values import Flag, Whole, Without


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PassOptions:
    """Which passes run, and how."""

    pipeline: str | None = None
    """me1, which adds screen-space light to direct light; or minecraft-rtx, which cleans and upscales light of one path
    a pixel. [default: me1]"""

    denoiser: str | None = None
    """Of minecraft-rtx: asvgf, diffuse and specular light apart; or denoise, all light in one. [default: asvgf]"""

    irradiance_cache: Flag = False
    """Of minecraft-rtx with asvgf: light that paths have found stays in the world, for paths and new pixels to read."""

    preset: str | None = None
    """low, medium, high or ultra. [default: high]"""

    composite: str | None = None
    """physical, or me1 for the formula of the original. [default: physical]"""

    units_per_metre: float | None = None
    """World units in a metre, of me1, whose distances are metres: 100 for worlds in centimetres, as Unreal's. [default:
    1]"""

    without: Without = ()
    """Stage to leave out, such as gi or gi.accumulate; may be repeated, or name several with commas."""

    set: Without = ()
    """Tunable to change, as NAME=VALUE (ao.estimate.radius=2.0, or gtao.radius=2.0 for short); may be repeated.
    `gbufrt passes` lists the names."""

    status: str | None = None
    """blindness or darkness: sight ends after 5 or 15 world units, and exposure pulses in darkness. [default: none]"""

    ui: Path | None = None
    """Picture with alpha (PNG), as large as the frames, to lay over them last: --set ui.picture=FILE."""

    warmup: Whole | None = None
    """Times that the passes run over the first frame, taken as standing still, to fill their history.
    [default: 3; minecraft-rtx: 15, each with paths of its own]"""

    debug: Flag = False
    """Also write a picture of every channel and signal, and one sheet of them all, under OUT/debug."""

    device: str = "cpu"
    """cpu, or cuda where there is a CUDA device."""

    config: Path | None = None
    """TOML file with options by their names here; [set] may be a table. The command line wins."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """Whether the work is spread over processes and machines."""

    cluster: str | None = None
    """Spread the work: local for processes here, or HOST:PORT of a Ray cluster that this machine is part of."""

    workers: Whole | None = None
    """Most worker processes of --cluster; they share its cores. [default: one a core, or per OMP_NUM_THREADS]"""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """What is written, and how."""

    precision: str | None = None
    """half rounds colours in the EXR, before the passes see them; float keeps all. [default: half; post: the files']"""

    compression: str = "zip"
    """zip, or dwaa, which loses what is hard to see of the coloured results, and nothing else."""

    only: Without = ()
    """Channel or signal to keep in the EXR, such as image,ao,depth; by default all. See `gbufrt passes` for names."""

    bits: Whole = 8
    """8 or 16: of the PNG. Those of 8 are dithered with blue noise, so that skies have no bands."""

    video: Path | None = None
    """Also encode all frames as this video: .mp4 (H.264) or .mov (ProRes), tagged BT.709."""
