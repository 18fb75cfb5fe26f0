"""`gbufrt video`: pictures that are there already, as a video."""

from __future__ import annotations

import re
from pathlib import Path

from gbufrt.commands.arguments.checks import check_file
from gbufrt.commands.arguments.values import at_least


def video(*files: Path, out: Path, fps: float = 24.0) -> None:
    """Encode PNG files as a video tagged BT.709: H.264 in .mp4, ProRes in .mov.

    Args:
        files: PNG files in order, such as shot.####.png, or folders of one sequence without gaps, as `gbufrt render`
            and `gbufrt post` write them.
        out: The video to write.
        fps: Frames a second.
    """
    at_least("--fps", fps, 1e-3, 1000)
    check_file("--out", out)

    from gbufrt.files.video import check_video, write_video

    check_video(out)
    pictures = [picture for file in files for picture in pictures_of(file)]
    write_video(out, pictures, fps=fps)
    print(f"wrote {len(pictures)} frame{'s' * (len(pictures) > 1)} at {fps:g} a second to {out}")


def pictures_of(path: Path) -> list[Path]:
    """The pictures that a name on the command line stands for, by number: a file, a pattern, or a folder.

    Raises:
        ValueError: a folder holds none, several sequences, or one with a gap; or no file fits a pattern.
    """
    from gbufrt.files.gbuffers.sequence import NUMBER, by_number, expanded

    if not path.is_dir():
        return expanded(path)
    found = [file for file in path.iterdir() if file.suffix.lower() == ".png" and NUMBER.search(file.stem)]
    if not found or any(re.fullmatch(r"frame_\d+", file.stem) for file in found):
        return numbered(path, "png")
    found = [
        file for file in found if file.with_suffix(".exr").exists()
    ] or found  # debug pictures have no frame beside
    places = [list(NUMBER.finditer(file.stem))[-1] for file in found]
    names = {
        f"{file.stem[: at.start()]}####{file.stem[at.end() :]}.png" for file, at in zip(found, places, strict=True)
    }
    if len(names) > 1:
        raise ValueError(f"{path} holds several sequences; give one of them, such as {path / min(names)}")
    numbers = sorted(int(at[0]) for at in places)
    if gaps := sorted({*range(numbers[0], numbers[-1])} - {*numbers}):
        raise ValueError(f"{path} lacks number {gaps[0]} of {min(names)}; give files to leave it out")
    return by_number(found)


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
