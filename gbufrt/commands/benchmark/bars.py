"""The table that bench ends with: what the speed of the whole must reach, computed from the figures of the run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal, NamedTuple

from gbufrt.commands.benchmark.peers import ATROUS, BILATERAL, KORNIA, OIDN_FAST

Figures = Mapping[str, Any]
"""What a run found, as in the file of --json."""
NO_OIDN = "OIDN is not installed: pip install 'gbufrt[denoise]'"
ANOTHER_MACHINE = "the bar is of a machine where older code made 6.0 Mrays/s over the horizon"
FEW, MANY = 10, 1000  # lamps


class Missing(Exception):
    """A run has not measured something; the message says why."""


class Found(NamedTuple):
    """What a run says about one bar."""

    value: float | None
    """What the bound is compared with; None where there is nothing to compare."""
    measured: str
    """For readers."""
    why: str = ""
    """There is no verdict."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table."""

    name: str
    measured: str
    bar: str
    value: float | None
    reached: bool | None
    """None without a verdict."""
    note: str = ""
    """Why there is none."""

    @property
    def verdict(self) -> str:
        """Whether the bar is reached: yes, no, or why that cannot be said."""
        if self.reached is not None:
            return "yes" if self.reached else "no"
        return f"{'not judged' if self.measured else 'not measured'}: {self.note}"

    def to_json(self) -> dict[str, Any]:
        """The row as JSON values."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class Bar:
    """What one figure must reach."""

    name: str
    bound: float
    better: Literal["lower", "higher"] = "lower"
    unit: str = "x"
    find: Callable[[Figures], Found]
    """Raises `Missing` where the run has not measured it."""

    def row(self, figures: Figures) -> Row:
        """The line of a run."""
        try:
            found = self.find(figures)
        except Missing as missing:
            found = Found(None, "", str(missing))
        bar = f"at {'most' if self.better == 'lower' else 'least'} {self.bound:g}{self.unit}"
        reached = None
        if found.value is not None and not found.why:
            reached = found.value <= self.bound if self.better == "lower" else found.value >= self.bound
        return Row(
            name=self.name, measured=found.measured, bar=bar, value=found.value, reached=reached, note=found.why
        )  # fmt: skip


def table(figures: Figures) -> list[Row]:
    """All bars, with what a run found."""
    return [bar.row(figures) for bar in BARS]


def _preset(figures: Figures, name: str) -> float:
    if name not in figures["presets"]:
        raise Missing(f"needs --presets {name}")
    return figures["presets"][name]["total_ms"]


def _figure(figures: Figures, name: str, option: str) -> Any:
    if name not in figures:
        raise Missing(f"needs {option}")
    return figures[name]


def _times(over: float, under: float, unit: str = "ms") -> Found:
    digits = 0 if max(over, under) >= 100 else 1
    return Found(over / under, f"{over / under:.2f}x: {over:.{digits}f} {unit} beside {under:.{digits}f}")


def _oidn(figures: Figures) -> Found:
    beside = _figure(figures, "oidn_ms", "--peers")
    if beside is None:
        raise Missing(NO_OIDN)
    return _times(_preset(figures, "high"), beside)


def _over_high(name: str) -> Callable[[Figures], Found]:
    return lambda figures: _times(_preset(figures, name), _preset(figures, "high"))


def _tracing(figures: Figures) -> Found:
    return _times(figures["tracing_ms"], _preset(figures, "high"))


def _rtx(figures: Figures) -> Found:
    return _times(figures["rtx"]["ms"], figures["rtx"]["me1_ms"])


def _rate(rate: Callable[[Figures], float]) -> Callable[[Figures], Found]:
    def find(figures: Figures) -> Found:
        found = rate(figures)
        return Found(found, f"{found:.2f} Mrays/s", ANOTHER_MACHINE)

    return find


def _lamps(figures: Figures) -> Found:
    series = _figure(figures, "scaling", "--scaling")
    times = dict(series["lamps"][0]["points"]) if "lamps" in series else {}
    if not {FEW, MANY} <= set(times):
        raise Missing(f"the run has no times of {FEW} and {MANY} lamps")
    return _times(times[MANY], times[FEW])


def _worlds(figures: Figures) -> Found:
    rates = _figure(figures, "worlds", "--scaling")
    return _times(rates["large"], rates["small"], "Mrays/s")


def _faster(ours: str, theirs: str) -> Callable[[Figures], Found]:
    def find(figures: Figures) -> Found:
        ms = _figure(figures, "filters_ms", "--peers")
        if theirs not in ms:
            raise Missing(NO_OIDN)
        return _times(ms[theirs], ms[ours])

    return find


def _beside_blender(figures: Figures, name: str) -> Mapping[str, float]:
    found = _figure(figures, "blender", "--peers")
    if "error" in found:
        raise Missing(found["error"])
    return found[name]


def _faster_than_blender(name: str) -> Callable[[Figures], Found]:
    def find(figures: Figures) -> Found:
        found = _beside_blender(figures, name)
        return _times(found["blender_ms"], found["ms"])

    return find


def _better_than_blender(name: str) -> Callable[[Figures], Found]:
    def find(figures: Figures) -> Found:
        found = _beside_blender(figures, name)
        gain = found["psnr"] - found["blender_psnr"]
        return Found(gain, f"{gain:+.1f} dB: {found['psnr']:.1f} beside {found['blender_psnr']:.1f}")

    return find


def _memory(figures: Figures) -> Found:
    peak = figures["hd"]["peak_mb"]
    if peak is None:
        raise Missing("the system does not report it")
    return Found(peak / 1e3, f"{peak / 1e3:.2f} GB")


BARS = (
    Bar(name="ME1 high, over one OIDN denoise of its frame", bound=1.0, find=_oidn),
    Bar(name="ME1 medium, over high", bound=0.5, find=_over_high("medium")),
    Bar(name="ME1 low, over high", bound=0.2, find=_over_high("low")),
    Bar(name="tracing a frame with direct light, over ME1 high", bound=1.0, find=_tracing),
    Bar(name="Minecraft RTX high, 480x270 to 960x540, over ME1 high at 480x270", bound=2.0, find=_rtx),
    Bar(
        name="primary rays over terrain, to the horizon, 854x480", bound=8.2, better="higher", unit=" Mrays/s",
        find=_rate(lambda figures: figures["rays"]["mrays_per_s"]),
    ),
    Bar(
        name="primary rays over terrain, a grazing view", bound=40.0, better="higher", unit=" Mrays/s",
        find=_rate(lambda figures: figures["rates"]["grazing"]),
    ),
    Bar(
        name="AO rays over terrain, radius 8", bound=10.0, better="higher", unit=" Mrays/s",
        find=_rate(lambda figures: figures["rates"]["occlusion"]),
    ),
    Bar(name=f"direct light of {MANY:,} lamps, over {FEW}", bound=2.0, find=_lamps),
    Bar(name="ray rate in 1024x256x1024 voxels, over 256x256x256", bound=0.5, better="higher", find=_worlds),
    Bar(
        name="bilateral denoise, 1080p: kornia's joint bilateral over it", bound=8.0, better="higher",
        find=_faster(BILATERAL, KORNIA),
    ),
    Bar(
        name="five wavelet iterations, 1080p: OIDN's fast mode over them", bound=5.0, better="higher",
        find=_faster(ATROUS, OIDN_FAST),
    ),
    Bar(
        name="motion blur, 1080p: Blender's Vector Blur over it", bound=20.0, better="higher",
        find=_faster_than_blender("motion_blur"),
    ),
    Bar(
        name="motion blur, 480x270: PSNR over Blender's Vector Blur", bound=0.0, better="higher", unit=" dB",
        find=_better_than_blender("motion_blur"),
    ),
    Bar(
        name="depth of field, 1080p: Blender's Defocus over it", bound=20.0, better="higher",
        find=_faster_than_blender("depth_of_field"),
    ),
    Bar(
        name="depth of field, 480x270: PSNR over Blender's Defocus", bound=0.0, better="higher", unit=" dB",
        find=_better_than_blender("depth_of_field"),
    ),
    Bar(name="peak memory of a process with ME1 high at 1080p", bound=1.5, unit=" GB", find=_memory),
    Bar(
        name="import gbufrt, tracer, post, beyond torch", bound=1.0, unit=" s",
        find=lambda figures: Found(figures["import_s"], f"{figures['import_s']:.2f} s"),
    ),
)  # fmt: skip
