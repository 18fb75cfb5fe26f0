"""Temporal accumulation: each pixel's mean over the frames that showed the same surface."""

from __future__ import annotations

import math
from dataclasses import replace

import torch
from torch import Tensor

from gbufrt import Frame, GBuffer, History, TemporalPass
from gbufrt.demands.pictures import check_sizes
from gbufrt.directions import length as norm
from gbufrt.history import check_history
from gbufrt.luminance import luminance
from gbufrt.mending import finite
from gbufrt.numeric import check_between
from gbufrt.specular import VIRTUAL_ROUGHNESS
from post.filters.signals import check_lead, signal_names, stack, unstack, wants_albedo
from post.filters.surfaces import surface
from post.history.antilag import typical_variance, variance_left
from post.history.changes import follow_changes
from post.history.fireflies import cut_outliers, still_missing, taken
from post.history.op import blended, taken_in
from post.history.planes import together
from post.history.read import read_history, read_sharp
from post.history.reproject import history_for, motion_of
from post.history.virtual import agreeing_motion, with_image
from post.passes.denoising.atrous import atrous

STORED = ("signal", "fast", "moments", "share")


def temporal(
    signal: Tensor,
    gbuffer: GBuffer,
    history: History | None = None,
    *,
    blend: float = 0.95,
    clamp: float = 2.0,
    firefly: float = 6.0,
    motion_response: float = 0.01,
    feedback: bool = False,
    sharp: bool = False,
    distance: Tensor | None = None,
    lead: int | None = None,
    excess: bool = False,
    longest: Tensor | None = None,
    lenient: Tensor | None = None,
    rare: bool = False,
    variance: bool = True,
) -> tuple[Tensor, History]:
    """Average a signal over time along the motion of surfaces.

    The mean is plain (1/N) until ``blend`` limits it, and restarts where no pixel of the frame before shows the same
    surface. A fast history detects changes of the light itself. Its difference from the slow one is averaged over the
    surface around. Where that exceeds what noise explains, the slow one is drawn toward it and becomes young again. The
    fast one is held to the present frame in the same way: see `post.history.changes`. Static detail cancels in the
    differences, so it is not clamped away, and noise loosens the clamp by itself.

    Args:
        signal: ``(B, C, H, W)`` of this frame, any unit; several signals stacked share one set of weights.
        gbuffer: of this frame.
        history: what this function returned for the frame before; None at first.
        blend: largest share of history; 1 accumulates for ever.
        clamp: standard deviations of noise by which histories may differ; 0 switches the test off.
        firefly: standard deviations above history and neighbours at which a sample is cut; 0 keeps all.
        motion_response: shortens the longest history by 1 / (1 + this x pixels moved).
        feedback: keep the history filtered by one wavelet iteration, as SVGF does: less noise, less detail.
        sharp: keep detail at the price of more noise at edges: history is read with Catmull-Rom weights, from the same
            plane alone. The less of its footprint shows the surface, the fewer frames it counts for, because what is
            left lies to one side. Only where next to nothing is left does it come from a step beside it.
        distance: ``(B, 1, H, W)`` world units to the reflected hit: history is then also read where its virtual image
            was, and the one that agrees better is taken.
        lead: how many of the first channels the tests use; all by default.
        excess: cut samples by `post.history.fireflies.cut_outliers` first, and accumulate what all cuts take.
        longest: ``(B, 1, H, W)`` the most frames that each mean may hold; by default ``blend`` alone limits them.
        lenient: ``(B, 1, H, W)`` bool: pixels for which a sharp history asks less, see `post.history.read.read_sharp`.
        rare: bright samples are rare, see `post.history.virtual.misfit`; surfaces of unlike roughness are told apart.
        variance: whether the variance of the mean is wanted; that takes a tenth of the time.

    Returns:
        The mean ``(B, C, H, W)`` and the history for the next frame: ``length`` holds N, ``signals["variance"]`` the
        variance ``(B, 1, H, W)`` of the mean's luminance if wanted, ``signals["excess"]`` the luminance cut.

    Raises:
        TypeError: what must be a tensor or a number is none, or kinds of floats are mixed.
        ValueError: a number is out of range, or a picture or the history has another size than the frame.

    Source: Schied et al. 2017 (SVGF), sections 4.1 and 4.2; fast history as in NVIDIA's ReLAX (Zhdan 2021).
    """
    check_between(0, 1, blend=blend)
    check_between(0, math.inf, clamp=clamp, firefly=firefly, motion_response=motion_response)
    check_history(gbuffer, history, *STORED, *(("excess",) if excess else ()))
    check_sizes(gbuffer.camera, depth=gbuffer.depth, signal=signal, distance=distance, longest=longest, lenient=lenient)
    check_lead(lead, signal)
    lead, signal = lead or signal.shape[1], finite(signal)  # the history would keep a bad pixel for ever
    names, state, given = (*STORED, "excess") if excess else STORED, None, signal if excess else None
    before, noise, past = 0.0, None, None if history is None else history.gbuffer
    if history is not None and past is not None:
        history = history.take()
        state = _fetch(signal, gbuffer, history, past, distance, lead, sharp, names, lenient, rare)
    del history, distance  # what was read of it is in the state: both need not be in memory with what comes out
    rough = gbuffer.roughness if rare else None
    if excess:
        geometry = surface(gbuffer.depth, gbuffer.normal, gbuffer.hit, gbuffer.camera, rough)
        first = signal.shape[1] + lead  # of the moments
        noise = None if state is None else typical_variance(state[:, first : first + 2], state[:, -1:])
        signal = cut_outliers(signal, geometry, state, noise, lead, firefly)
        del geometry
    if state is None or past is None:
        light, length = luminance(signal, lead), torch.ones_like(signal[:, :1])
        state = torch.cat([signal, signal[:, :lead], light, light * light, length, length], dim=1)
    else:
        if excess:
            before, state = state[:, -2:-1], torch.cat([state[:, :-2], state[:, -1:]], dim=1)
        sample = taken_in(signal, state, lead=lead, firefly=firefly)
        signal, changes = sample.signal, None  # as it came it need not be in memory any more
        if clamp > 0:
            changes = follow_changes(sample, state, gbuffer, lead=lead, clamp=clamp, roughness=rough)
        if changes is not None and isinstance(before, Tensor):
            was = luminance(state, lead)
            before = still_missing(before, was, was + luminance(changes.slow, lead))
        del sample
        moved = norm(motion_of(gbuffer, past.camera)[0])
        most = 1 / (1 + motion_response * moved) / max(1 - blend, 1e-9)
        most = most if longest is None else torch.minimum(most, longest)
        state = blended(signal, state, most, changes, lead=lead)
        del changes
    *parts, length = state.split([signal.shape[1], lead, 2, 1, 1], dim=1)  # side by side, see `together`
    new = dict[str, Tensor](zip(STORED, parts, strict=True))
    if given is not None:
        new["excess"] = before + (taken(given, signal, lead) - before) / length
    mean = new["signal"]
    if variance or feedback:
        new["variance"] = variance_left(signal, new["moments"], new["share"], length, gbuffer, lead)
    if feedback:
        new["signal"], _ = atrous(
            mean, gbuffer.depth, gbuffer.normal, hit=gbuffer.hit, camera=gbuffer.camera, iterations=1,
            variance=new["variance"], lead=lead,
        )  # fmt: skip
    return mean, History(length=length, signals=new, gbuffer=gbuffer.geometry())


def _fetch(
    signal: Tensor,
    gbuffer: GBuffer,
    history: History,
    before: GBuffer,
    distance: Tensor | None,
    lead: int,
    sharp: bool,
    names: tuple[str, ...],
    lenient: Tensor | None,
    rare: bool,
) -> Tensor:
    """The named signals and the length of the history, reprojected to this frame."""
    kept = history.signals
    if kept["signal"].shape[1] != signal.shape[1]:
        raise ValueError(
            f"the history holds {kept['signal'].shape[1]} channels but the signal has {signal.shape[1]}; "
            "start with state=None when signals come or go"
        )
    everything = together([*(kept[name] for name in names), history.length])
    if sharp:
        state = read_sharp(gbuffer, before, everything, lenient=lenient)
        if distance is not None:
            state = with_image(state, everything, signal[:, :lead], gbuffer, before, distance, rare=rare)
        return state
    motion = None
    if distance is not None:  # all channels are read once: two readings of them were most of a frame's memory
        motion = agreeing_motion(everything[:, :lead], signal[:, :lead], gbuffer, before, history.length, distance)
    return read_history(gbuffer, before, everything, motion=motion, length=history.length).image


class Temporal(TemporalPass):
    """Accumulate one signal, or several by one set of weights. See `temporal`.

    Writes ``<signal>_history``, the number of frames in each pixel's mean, and for denoisers that follow
    ``<signal>_variance``, of its output, without albedo where that was divided out. The confidence of a reflection is
    averaged with it. In frames that are ``steady`` no changes are looked for, lest noise is taken for them.

    Args:
        signal: name of a signal, or several; the first leads.
        blend: see `temporal`, as the rest.
        virtual: for reflections: also back-project along the motion of the virtual image.
        demodulate: divide albedo out first; by default for ``gi``.
        variance: see `temporal`.
    """

    def __init__(
        self,
        *,
        signal: str | tuple[str, ...] = "ao",
        blend: float = 0.95,
        clamp: float = 2.0,
        firefly: float = 6.0,
        motion_response: float = 0.01,
        feedback: bool = False,
        virtual: bool = True,
        demodulate: bool | None = None,
        variance: bool = True,
    ) -> None:
        super().__init__()
        self.signal = signal
        self.blend = blend
        self.clamp = clamp
        self.firefly = firefly
        self.motion_response = motion_response
        self.feedback = feedback
        self.virtual = virtual
        self.demodulate = demodulate
        self.variance = variance
        names = signal_names(signal)
        self.reads = frozenset({"depth", "normal", "hit", names[0]})
        self.optional = frozenset({*names[1:], "motion", "motion_z", "normal_geo", "object_id", "albedo", "roughness"})
        if names[0] == "reflection" and virtual:
            self.optional |= {"reflection_distance"}
        self.writes = frozenset({*names, f"{names[0]}_history", *([f"{names[0]}_variance"] if variance else [])})

    def forward(self, frame: Frame, state: History | None = None) -> tuple[Frame, History]:
        divide = wants_albedo(names := signal_names(self.signal), self.demodulate)
        mean, state = temporal(
            stack(frame, names, demodulate=divide), frame.gbuffer, history_for(state, frame.cut), blend=self.blend,
            clamp=0.0 if frame.steady else self.clamp, firefly=self.firefly, motion_response=self.motion_response,
            feedback=self.feedback, variance=self.variance, distance=_reflected(frame, names, self.virtual),
            lead=frame.read(names[0]).shape[1],
        )  # fmt: skip
        frame = unstack(frame, names, mean, demodulate=divide, views=True)  # the state holds the mean
        if self.variance:
            frame = frame.write(f"{names[0]}_variance", state.signals["variance"])
        kept = {name: state.signals[name] for name in STORED}  # the next frame reads no variance
        return frame.write(f"{names[0]}_history", state.length), replace(state, signals=kept)


def _reflected(frame: Frame, names: tuple[str, ...], virtual: bool) -> Tensor | None:
    """Distance to the reflected hit, zero where the surface is too rough to hold an image."""
    distance, roughness = frame.reflection_distance, frame.gbuffer.roughness
    if not virtual or names[0] != "reflection" or distance is None:
        return None
    return distance if roughness is None else torch.where(roughness <= VIRTUAL_ROUGHNESS, distance, 0.0)
