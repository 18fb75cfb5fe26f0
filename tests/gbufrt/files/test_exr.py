"""EXR: every bit comes back, and no file, however broken, does more than raise one clear error."""

from __future__ import annotations

import resource
from dataclasses import fields
from pathlib import Path

import boxes
import numpy as np
import OpenEXR
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gbufrt import Camera, Frame
from gbufrt.files.exr import read_exr, read_notes, write_exr
from gbufrt.files.guard import read_parts
from gbufrt.files.output import atomic
from gbufrt.tree import map_tensors

SIZE = (7, 12)


def rich_frame(size: tuple[int, int] = SIZE, seed: int = 0) -> Frame:
    """Every kind of layer: awkward floats, negative and large ids, own sizes, a layer behind, a jittered camera."""
    random = torch.Generator().manual_seed(seed)
    camera = boxes.camera(size).with_jitter((0.25, -0.125))
    frame = boxes.frame(camera, previous=boxes.camera(size, dx=0.3), index=41)
    noise = torch.rand(1, 3, *size, generator=random)
    noise.view(-1)[:6] = torch.tensor([torch.nan, torch.inf, -torch.inf, -0.0, 1e-42, 3.4e38])
    ids = torch.randint(-(2**31), 2**31 - 1, (1, 1, *size), generator=random).int()
    return frame.replace(
        time=0.1 + 0.2,
        cut=torch.tensor([True]),
        emitters_sampled=False,
        emitters_mirrored=True,
        behind=boxes.frame(camera, sun=False),
        gi=noise,
        ao=noise[:, :1],
        exposure=torch.rand(1, 1, 1, 1, generator=random),
        gbuffer=frame.gbuffer.replace(material_id=ids, object_id=ids.long()),
        extra={
            "gi_length": noise[:, 1:2],
            "frame": noise[..., :2, :3],
            "moments": noise.repeat(1, 2, 1, 1),
            "on": ids > 0,
        },
    )


def same_camera(a: Camera, b: Camera) -> bool:
    return all(
        torch.equal(x, y) and x.dtype == y.dtype if isinstance(x, torch.Tensor) else x == y
        for x, y in ((getattr(a, f.name), getattr(b, f.name)) for f in fields(Camera))
    )


def assert_same(a: Frame, b: Frame) -> None:
    assert a.present == b.present
    for name in a.present:
        x, y = a.read(name), b.read(name)
        assert x.dtype == y.dtype, name
        assert x.contiguous().numpy().tobytes() == y.contiguous().numpy().tobytes(), name
    assert (a.index, a.time, a.emitters_sampled) == (b.index, b.time, b.emitters_sampled)
    assert a.emitters_mirrored == b.emitters_mirrored
    assert (a.cut is None) == (b.cut is None)
    assert a.cut is None or torch.equal(a.cut, b.cut)  # pyright: ignore[reportArgumentType]
    assert same_camera(a.gbuffer.camera, b.gbuffer.camera)
    before, after = a.gbuffer.previous_camera, b.gbuffer.previous_camera
    assert (before is None) == (after is None)
    assert before is None or after is None or same_camera(before, after)
    assert (a.behind is None) == (b.behind is None)
    if a.behind is not None and b.behind is not None:
        assert_same(a.behind, b.behind)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("exr") / "frame.exr"
    write_exr(path, rich_frame(), notes={"preset": "low"})
    return path.read_bytes()


@pytest.mark.parametrize("size", [(7, 12), (127, 73), (1, 5), (1, 1)])
def test_round_trip_is_bit_exact(tmp_path: Path, size: tuple[int, int]):
    frame = rich_frame(size) if min(size) > 1 else boxes.frame(boxes.camera(size))
    write_exr(tmp_path / "a" / "b.exr", frame, notes={"preset": "low", "set": {"gtao.radius": 2.0}})
    assert_same(read_exr(tmp_path / "a" / "b.exr"), frame)
    assert read_notes(tmp_path / "a" / "b.exr") == {"preset": "low", "set": {"gtao.radius": 2.0}}
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["b.exr"]


def test_orthographic_camera_and_bare_frame(tmp_path: Path):
    full = boxes.frame(boxes.camera(SIZE, orthographic=True))
    g = full.gbuffer
    bare = Frame(gbuffer=type(g)(camera=g.camera, depth=g.depth, hit=g.hit, normal=g.normal))
    write_exr(tmp_path / "a.exr", bare)
    assert_same(read_exr(tmp_path / "a.exr"), bare)
    assert read_notes(tmp_path / "a.exr") == {}


def test_float64_is_rounded_and_its_camera_kept(tmp_path: Path):
    frame = boxes.frame(boxes.camera(SIZE)).to(torch.float64)
    write_exr(tmp_path / "a.exr", frame)
    back = read_exr(tmp_path / "a.exr")
    assert same_camera(back.gbuffer.camera, frame.gbuffer.camera)
    assert torch.equal(back.gbuffer.depth, frame.gbuffer.depth.float())


def test_batch_needs_a_choice(tmp_path: Path):
    one, two = rich_frame(seed=1), rich_frame(seed=2)
    one, two = one.replace(extra={}, exposure=None), two.replace(extra={}, exposure=None)
    left, right = [], []
    map_tensors(lambda t: left.append(t) or t, one)
    map_tensors(lambda t: right.append(t) or t, two)
    pairs = iter(zip(left, right, strict=True))
    both = map_tensors(lambda _: torch.cat(next(pairs)), one)
    with pytest.raises(ValueError, match=r"batch of 2.*element=0\.\.1"):
        write_exr(tmp_path / "a.exr", both)
    with pytest.raises(ValueError, match=r"element must lie in 0\.\.1, got 2"):
        write_exr(tmp_path / "a.exr", both, element=2)
    assert not list(tmp_path.iterdir())
    for element, frame in enumerate((one, two)):
        write_exr(tmp_path / "a.exr", both, element=element)
        assert_same(read_exr(tmp_path / "a.exr"), frame)


def test_other_programs_find_their_layers(tmp_path: Path):
    frame = rich_frame().replace(composite=torch.rand(1, 3, *SIZE))
    write_exr(tmp_path / "a.exr", frame)
    parts = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).parts
    main = parts[0].channels
    wanted = ["R", "G", "B", "depth.Z", "normal.X", "normal.Y", "normal.Z", "motion.X", "albedo.G", "ao.X", "hit.A"]
    assert set(wanted) <= set(main)
    assert "behind.depth.Z" in main
    assert main["material_id.X"].pixels.dtype == np.uint32
    shown = frame.read("composite") * frame.read("exposure")
    assert np.array_equal(main["G"].pixels, shown[0, 1].numpy())
    assert "planar" in parts[0].header["gbufrt"]
    assert [p.name() for p in parts[1:]] == ["own.environment", "own.exposure", "own.frame", "own.behind.environment"]


def test_signals_that_cannot_be_written(tmp_path: Path):
    frame = boxes.frame(boxes.camera(SIZE))
    with pytest.raises(ValueError, match="count must fit 32 bits"):
        write_exr(tmp_path / "a.exr", frame.write("count", torch.full((1, 1, *SIZE), 2**40)))
    with pytest.raises(ValueError, match=r"must be of type float32.*got float16"):
        write_exr(tmp_path / "a.exr", frame.write("half", torch.zeros(1, 1, *SIZE).half()))
    clash = frame.replace(behind=frame).write("behind.ao", torch.zeros(1, 1, *SIZE))
    with pytest.raises(ValueError, match="taken; rename it"):
        write_exr(tmp_path / "a.exr", clash.replace(behind=frame.write("ao", torch.zeros(1, 1, *SIZE))))
    assert not list(tmp_path.iterdir())


def test_missing_and_foreign_files(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match=r"a\.exr does not exist"):
        read_exr(tmp_path / "a.exr")
    with pytest.raises(ValueError, match="is not a file"):
        read_exr(tmp_path)
    for content, message in ((b"", "is empty"), (b"\x89PNG\r\n", "not an OpenEXR file"), (b"v/1", "not an OpenEXR")):
        (tmp_path / "b.exr").write_bytes(content)
        with pytest.raises(ValueError, match=message):
            read_exr(tmp_path / "b.exr")
    OpenEXR.File({}, {"R": np.zeros((2, 2), np.float32)}).write(str(tmp_path / "c.exr"))
    with pytest.raises(ValueError, match="not written by gbufrt"):
        read_exr(tmp_path / "c.exr")


def test_every_truncation_is_one_quiet_error(tmp_path: Path, stored: bytes, capfd: pytest.CaptureFixture[str]):
    path = tmp_path / "a.exr"
    for length in [*range(0, len(stored), 97), len(stored) - 1]:
        path.write_bytes(stored[:length])
        with pytest.raises(ValueError, match=r"a\.exr"):
            read_exr(path)
        with pytest.raises(ValueError, match=r"a\.exr is (damaged|not an OpenEXR)"):
            read_parts(path)
    assert capfd.readouterr() == ("", "")


def test_absurd_sizes_allocate_nothing(tmp_path: Path, stored: bytes):
    width, height = SIZE[1] - 1, SIZE[0] - 1
    window = np.array([0, 0, width, height], dtype="<i4").tobytes()
    assert window in stored
    path = tmp_path / "a.exr"
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for x, y, message in ((99999, 99999, "cannot hold"), (7999, 7999, "cannot hold|damaged"), (-5, 3, "damaged")):
        path.write_bytes(stored.replace(window, np.array([0, 0, x, y], dtype="<i4").tobytes()))
        with pytest.raises(ValueError, match=message):
            read_exr(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 64 << 10  # kilobytes
    path.write_bytes(stored)
    assert len(read_parts(path)) == 5


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_flipped_bytes_never_crash(tmp_path: Path, stored: bytes, data: st.DataObject):
    broken = bytearray(stored)
    place = st.one_of(st.integers(0, min(12000, len(stored) - 1)), st.integers(0, len(stored) - 1))
    for at, value in data.draw(st.lists(st.tuples(place, st.integers(0, 255)), min_size=1, max_size=4)):
        broken[at] = value
    (tmp_path / "a.exr").write_bytes(broken)
    message, size = "", SIZE
    try:
        size = read_exr(tmp_path / "a.exr").gbuffer.camera.size
    except ValueError as error:
        message = str(error)
    assert size == SIZE
    assert not message or ("a.exr" in message and "\n" not in message)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"format": 1', '"format": 9'),
        ('"layers": {', '"lasers": {'),
        ('"float32"', '"bfloat1"'),
        ('"depth.Z"', '"depth.Q"'),
        ('"near": 0.05', '"near": 9e99'),
        ('"size": [7, 12]', '"size": [7, 1e]'),
        ('"size": [7, 12]', '"size": [9, 12]'),
        ('"intrinsics": [[', '"intrinsics": [{'),
    ],
)
def test_nonsense_in_the_attribute(tmp_path: Path, stored: bytes, old: str, new: str):
    assert len(old) == len(new)
    assert old.encode() in stored
    (tmp_path / "a.exr").write_bytes(stored.replace(old.encode(), new.encode(), 1))
    with pytest.raises(ValueError, match=r"a\.exr"):
        read_exr(tmp_path / "a.exr")


def test_a_failed_write_leaves_the_old_file(tmp_path: Path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def interrupted() -> None:
        with atomic(path) as part:
            part.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
