"""What a file gives under the names of a profile: channels, direct light, finished pictures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from gbufrt.files.gbuffers.layers import Layers
from gbufrt.files.gbuffers.profile import CHANNELS, Profile


@dataclass(frozen=True, kw_only=True)
class Light:
    """Where a frame's light comes from.

    Args:
        products: layers whose products make the direct light when summed, as channels; those that are there whole.
        lacking: names of layers that are missing from products of which another factor is there, with the channels of
            those factors.
        finished: channels of the picture with all its light.
        mirrors: whether the products hold the sky as mirrors show it.
    """

    products: list[list[list[str]]]
    lacking: dict[str, list[list[str]]]
    finished: list[str]
    mirrors: bool = False


class Named:
    """Channels of one layer of a file, such as a view layer, by what a profile calls them.

    Args:
        layers: of the file.
        profile: its names.

    Raises:
        ValueError: the file has no depth by that profile.
    """

    def __init__(self, layers: Layers, profile: Profile) -> None:
        self.layers, self.profile = layers, profile
        names, depth = profile.channels.get("depth", ()), depth_of(layers, profile)
        there = tuple(name for name in layers.layers_of(names, any_case=profile.any_case) if name)
        if not depth and profile.layer and there:
            raise ValueError(f"{layers.path} has no depth in the layer {profile.layer!r}; it has {', '.join(there)}")
        if not depth:
            raise ValueError(
                f"{layers.path} has no depth under {', '.join(names) or 'any name'}; choose another profile"
            )
        self.layer = profile.layer or layers.layer_of(depth[0])
        self.others = () if profile.layer else there
        """All layers that have depth, where the profile does not choose one."""
        if self.layer in self.others:
            self.layer = max(self.others, key=layers.passes_in)

    @property
    def chosen(self) -> str:
        """What to say where several layers have depth; else nothing."""
        if len(self.others) < 2:
            return ""
        return (
            f"depth is in the layers {', '.join(self.others)}; {self.layer} is taken, as none has more passes: --layer "
            "NAME, or layer = in a profile, takes another"
        )

    @property
    def depth(self) -> list[str]:
        """The file's channels that tell depth: its own, or else the three of positions."""
        return self.keys("depth") or self.keys("position")

    @property
    def motion(self) -> tuple[list[str], Profile]:
        """The file's channels of motion, none where it lacks it, and the profile by which they are to be read."""
        if keys := self.keys("motion"):
            return keys, self.profile
        return self.keys("motion_next"), replace(self.profile, motion_target="next")

    def keys(self, channel: str) -> list[str]:
        """The file's channels that make one of `CHANNELS`; none where it lacks it."""
        return self.find(self.profile.channels.get(channel, ()), CHANNELS[channel])

    def find(self, names: Iterable[str], count: int) -> list[str]:
        """The file's channels of the first of ``names`` that is there with ``count`` numbers; or none."""
        return self.layers.find(names, count, self.layer, any_case=self.profile.any_case)

    def light(self, *, whole: bool = False) -> Light:
        """The file's channels that hold light. Emission and sky alone are no direct light where all light is there.

        ``whole``: take the picture with all its light, where it is there, rather than direct light.
        """
        products, lacking, lit, mirrors = [], dict[str, list[list[str]]](), False, False
        for names in self.profile.direct:
            factors = {name: self.find((name,), 3) for name in names}
            if all(factors.values()):
                products.append(list(factors.values()))
                lit = lit or not {*names} <= {*self.profile.emitted}
                mirrors = mirrors or not {*names}.isdisjoint(self.profile.mirrors)
            elif any(factors.values()):
                lacking |= {name: [*filter(None, factors.values())] for name, keys in factors.items() if not keys}
        finished = self.find(self.profile.finished, 3)
        if finished and (whole or not lit):
            products = []
        return Light(
            products=products,
            lacking=lacking if products else {},
            finished=finished,
            mirrors=mirrors and bool(products),
        )


def depth_of(layers: Layers, profile: Profile) -> list[str]:
    """The channel of depth by a profile, or else those of positions; none where a file has neither."""
    for channel in ("depth", "position"):
        names = profile.channels.get(channel, ())
        if found := layers.find(names, CHANNELS[channel], profile.layer, any_case=profile.any_case):
            return found
    return []
