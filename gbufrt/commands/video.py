"""`gbufrt video`: pictures that are there already, as a video."""

from __future__ import annotations

import re
from pathlib import Path

from gbufrt.commands.arguments.checks import check_file
from gbufrt.commands.arguments.values import at_least


def video(*files: Path, out: Path, fps: float = 24.0) -> None:
    """Encode PNG files as a video tagged BT.709: H.264 in .mp4, ProRes in .mov.

    Args:
        files: PNG files in order, or folders of them (their frame_*.png, which must be numbered without gaps).
        out: The video to write.
        fps: Frames a second.
    """
    at_least("--fps", fps, 1e-3, 1000)
    check_file("--out", out)

    from gbufrt.files.video import check_video, write_video

    check_video(out)
    pictures = [picture for file in files for picture in (numbered(file, "png") if file.is_dir() else [file])]
    write_video(out, pictures, fps=fps)
    print(f"wrote {len(pictures)} frames at {fps:g} a second to {out}")


def numbered(folder: Path, ending: str) -> list[Path]:
    """The frame_*.png of a folder, or of another ending, by number.

    Raises:
        ValueError: there are none, or one is missing between two others.
    """
    named = ((re.fullmatch(rf"frame_(\d+)\.{ending}", path.name), path) for path in folder.iterdir())
    found = {int(match[1]): path for match, path in named if match}
    if not found:
        raise ValueError(f"{folder} holds no frame_*.{ending}; give files, or a folder that `gbufrt render` wrote")
    for number in range(min(found), max(found)):
        if number not in found:
            raise ValueError(
                f"{folder} lacks frame_{number:04d}.{ending} between others; make it (render --resume), or give files"
            )
    return [found[number] for number in sorted(found)]
