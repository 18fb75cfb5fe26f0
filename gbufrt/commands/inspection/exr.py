"""What an EXR file holds: layers and values, its writer, gbufrt's channels in it, and whether they agree."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from gbufrt.commands.foreign import Source
from gbufrt.files.exr import read_exr
from gbufrt.files.gbuffers.detect import detect, named_by
from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.light import lacking
from gbufrt.files.gbuffers.named import Named
from gbufrt.files.gbuffers.profile import AUTO, CHANNELS, Profile
from gbufrt.files.gbuffers.read import nothing_hit
from gbufrt.files.gbuffers.sequence import Shot, shot_parts
from gbufrt.files.guard import Part
from gbufrt.files.header import ATTRIBUTE
from gbufrt.files.png import to_pil, write_png
from gbufrt.files.precision import MOST_HALF
from gbufrt.files.raw_views import pictures, span
from gbufrt.files.views import debug_names, debug_view, sheet_of
from gbufrt.frame import Frame

MISSING = {
    "depth": "that of positions",
    "normal": "estimated from depth",
    "motion": "that of a world that stands still, from depth and cameras",
    "albedo": "absent",
    "roughness": "absent: no reflections, unless --passes asks for them on a guess",
    "metallic": "absent: nothing counts as metal",
    "emission": "absent: lamps in sight count as lit surfaces, whose light GI and mirrors add again",
    "thickness": "estimated from widths and sides in the picture",
}


@dataclass
class Inspector:
    """Looks at EXR files, each with the one before it where its number counts on.

    Args:
        source: the files with their cameras, where these are known.
    """

    source: Source
    _last: Frame | None = field(default=None, init=False)

    def show(self, console: Console, shot: Shot, out: Path | None) -> None:
        """Print all about one frame, and write its contact sheet into ``out``.

        Raises:
            ValueError: it is damaged, or a camera does not fit it.
        """
        path, parts = shot.files[0], shot_parts(shot.files)
        layers = Layers(path, parts)
        console.print(f"[bold]{escape(str(shot))}[/bold]: {_outside(shot, parts)}", soft_wrap=True)
        console.print(_layer_table(layers))
        own = any(ATTRIBUTE in part.header for part in parts)
        frame = _own(console, path) if own else self._foreign(console, shot, layers)
        if out is not None:
            sheet = out / f"{shot.name}_sheet.png"
            write_png(sheet, _sheet(layers, frame, own=own))
            console.print(f"wrote {escape(str(sheet))}", soft_wrap=True)

    def _foreign(self, console: Console, shot: Shot, layers: Layers) -> Frame | None:
        profile = self.source.profile
        if profile == "auto":
            try:
                found = detect(shot.files)
            except ValueError as error:
                console.print(escape(str(error)), soft_wrap=True)
                return None
            profile = found.name
            lines = [f"taken for {profile}, {found.certainty:.0%} sure:", *found.reasons]
            console.print(escape("\n  ".join(lines)), soft_wrap=True)
        named = named_by(layers, self.source.read_by(shot))
        if named.chosen:
            console.print(escape(named.chosen), soft_wrap=True)
        console.print(_channel_table(named, estimates=self.source.fov is not None))
        if layers.views:
            console.print(escape(f"views are {', '.join(layers.views)}; {layers.views[0]} is taken"))
        carried = None if self.source.fov or self.source.cameras else self.source.carried(shot)
        if carried is not None:
            console.print(escape(f"camera in the file: {carried}"), soft_wrap=True)
        elif self.source.fov is None and self.source.cameras is None:
            console.print("whether the channels agree can be told with --camera, in part with --fov")
            return None
        with warnings.catch_warnings():  # the table has told what is missing
            warnings.simplefilter("ignore")
            self._last, wrong = self.source.read(shot, self._last)
        if not bool(self._last.gbuffer.hit.any()):
            raw = layers.stack(named.depth[:1])
            wrong = [f"the file {nothing_hit(layers, raw, named.profile, named.depth[0])}"]
        tested = ["the kind of depth with planes"] if self.source.fov is not None else ["depth with normals"]
        _tell_agreement(console, self._last, tested, wrong)
        return self._last


def _own(console: Console, path: Path) -> Frame | None:
    console.print(f"taken for gbufrt's own, because the header has {ATTRIBUTE}")
    try:
        frame = read_exr(path)
    except ValueError as error:
        console.print(escape(str(error)), soft_wrap=True)
        return None
    console.print(escape(repr(frame)), soft_wrap=True)
    _tell_agreement(console, frame, ["depth with normals"], [])
    return frame


def _tell_agreement(console: Console, frame: Frame, tested: list[str], wrong: list[str]) -> None:
    """What `Frame.validate` and the agreement tests say; ``tested`` by the latter, motion apart."""
    try:
        frame.validate()
    except ValueError as error:
        wrong = [*wrong, str(error)]
    for line in wrong:
        console.print(f"[red]disagrees:[/red] {escape(line)}", soft_wrap=True)
    if not wrong:
        g = frame.gbuffer
        moved = ["motion with the cameras"] if g.motion is not None and g.previous_camera is not None else []
        console.print(f"agrees: {', '.join(tested + moved)}")


def _outside(shot: Shot, parts: list[Part]) -> str:
    """Size, parts and compression of a file, or of those of one frame."""
    height, width = parts[0].whole
    packed = {getattr(part.header.get("compression"), "name", "?").removesuffix("_COMPRESSION") for part in parts}
    count = f"{len(parts)} part{'' if len(parts) == 1 else 's'}"
    size = sum(file.stat().st_size for file in shot.files)
    crop = f", pixels for {parts[0].size[1]}x{parts[0].size[0]}" if parts[0].size != parts[0].whole else ""
    return f"{width}x{height}{crop}, {count}, {', '.join(sorted(packed))}, {size / 1e6:.3g} MB"


def _layer_table(layers: Layers) -> Table:
    """A row a layer: channels, type and, unless the first one's, size, range of values, pixels that are not finite."""
    table, groups = _table("layer", "channels", "type", "values"), layers.groups()
    sizes = {base: layers.part(keys[0]).size for base, keys in groups.items()}
    first = next(iter(sizes.values()))
    planes = {base: [layers.pixels(key) for key in keys] for base, keys in groups.items()}
    bad = {base: int(np.any([~np.isfinite(plane) for plane in some], axis=0).sum()) for base, some in planes.items()}
    if any(bad.values()):
        table.add_column("not finite")
    for base, keys in groups.items():
        height, width = sizes[base]
        size = "" if sizes[base] == first else f", {width}x{height}"
        letters = " ".join(key.rpartition(".")[2] for key in keys)
        row = [base, letters, planes[base][0].dtype.name + size, span(planes[base])]
        table.add_row(*map(escape, row), *([str(bad[base] or "")] if any(bad.values()) else []))
    return table


def _table(*columns: str) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _channel_table(named: Named, *, estimates: bool) -> Table:
    """A row for each of gbufrt's channels: what of the file makes it, or what is done about its absence.

    ``estimates``: the camera's pose is not known, so that the file's normals are of no use.
    """
    table, profile = _table("gbufrt's", "from"), named.profile
    told = {
        "depth": f"{profile.depth_kind}, sky {'by its pixels' if profile.sky == MOST_HALF else f'at {profile.sky:g}'}",
        "normal": f"{profile.normal_space} space, {profile.up} up" if not estimates else _unposed(profile),
        "motion": "in the units that fit the cameras"
        if profile.motion_fitted is True
        else f"{profile.motion_unit} to the {named.motion[1].motion_target} frame"
        + (", unless others fit the cameras" if profile.motion_fitted else ""),
    }
    optional = ("position",) if named.light().products else ("emission", "position")
    shown = [name for name in (*CHANNELS, "thickness") if name != "motion_next"]
    for channel in (name for name in shown if name not in optional or named.keys(name)):
        keys = named.keys(channel) if channel in CHANNELS else []
        keys = named.motion[0] if channel == "motion" else keys
        text = _short(keys) + (f" ({told[channel]})" if channel in told else "") if keys else MISSING[channel]
        table.add_row(channel, escape(text), style="" if keys else "dim")
    light = named.light()
    if light.products:
        products = (" x ".join(_short(keys) for keys in factors) for factors in light.products)
        table.add_row("radiance", escape(" + ".join(products)))
        if missing := lacking(named, light, named.layers.part(named.depth[0]).whole):
            table.add_row("", escape(f"without {', '.join(missing)}, which should be rendered too"))
    elif light.finished:
        table.add_row("composite", escape(f"{_short(light.finished)}, a finished picture: no light is added to it"))
    else:
        table.add_row("radiance", "no light that the profile knows: passes have nothing to work on", style="red")
    return table


def _unposed(profile: Profile) -> str:
    """What is done with normals where the camera's pose is not known."""
    if profile.normals_turn:
        return f"{profile.normal_space} space"
    return "used if in the camera's space" if profile.normal_space == AUTO else "not used without --camera"


def _short(keys: list[str]) -> str:
    """Channels of one layer: ``N.X``, ``N.Y``, ``N.Z`` as ``N.XYZ``."""
    base = keys[0].rpartition(".")[0]
    return f"{base}.{''.join(key.rpartition('.')[2] for key in keys)}".removeprefix(".")


def _sheet(layers: Layers, frame: Frame | None, *, own: bool) -> Image.Image:
    """The channels of gbufrt's own frame; or every layer as a file has it, then the frame as gbufrt reads it."""
    views = {} if own and frame is not None else {name: to_pil(picture) for name, picture in pictures(layers)}
    if frame is not None:
        mark, behind = ("" if own else "gbufrt: "), frame.behind
        names = [*debug_names(frame), *(() if behind is None else (f"behind.{n}" for n in debug_names(behind)))]
        views |= {mark + name: to_pil(debug_view(frame, name)) for name in names}
    return sheet_of(views)
