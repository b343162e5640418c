"""How many prims a scene composes to, counted from its layers before any stage exists.

References multiply: 2.6 kB compose to hundreds of thousands of prims, and opening such a stage takes seconds for each.
Here a part that is referenced often is counted once. Variants count by the selection that the layers make. The count
may differ a little from the stage's own, which is what decides in the end.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

from pxr import Sdf

from renderer.gate.layers import LayerContent
from renderer.gate.problems import RejectedScene

MAX_SITES = 4096
"""Places that compose one prim."""
MAX_WAYS = 16_384
"""Ways that lead to them: USD follows every one, and two references a level make a million in 20 levels."""
MAX_STATES = 2_000_000
"""Different sets of places that are looked at."""

Resolve = Callable[[str, str], str | None]
Site = tuple[str, Sdf.Path]
"""A layer that is opened by itself, with its sublayers, and a path in it."""


class PrimCounter:
    """Counts composed prims.

    Args:
        layers: The scene's layers by name.
        resolve: Name of the layer that a layer's name and an authored path lead to, or None.
        limit: Beyond this many it stops.
    """

    def __init__(self, layers: dict[str, LayerContent], resolve: Resolve, limit: int) -> None:
        self._layers = layers
        self._resolve = resolve
        self._limit = limit
        self._stacks: dict[str, tuple[str, ...]] = {}
        self._counts: dict[tuple[Site, ...], int] = {}

    def count(self, root: str) -> int:
        """Prims of the scene with that root layer.

        Raises:
            RejectedScene: They are more than the limit, or too intricate to be counted.
        """
        before = sys.getrecursionlimit()
        sys.setrecursionlimit(20_000)
        try:
            total = self._below(((root, Sdf.Path.absoluteRootPath),))
        except RecursionError as error:
            raise RejectedScene("scene-too-large", "The scene's prims are too deep in each other.") from error
        finally:
            sys.setrecursionlimit(before)
        if total > self._limit:
            raise RejectedScene("scene-too-large", f"The scene has {total} prims, more than {self._limit}.")
        return total

    def _below(self, sites: tuple[Site, ...]) -> int:
        """Prims below those that the sites compose."""
        known = self._counts.get(sites)
        if known is not None:
            return known
        if len(self._counts) > MAX_STATES:
            raise RejectedScene("scene-too-large", "The scene's composition is too intricate.")
        # A prim that contains itself is left out by the composition too.
        self._counts[sites] = 0
        children: dict[str, list[Site]] = {}
        for site in sites:
            for name in self._child_names(site):
                children.setdefault(name, []).append((site[0], site[1].AppendChild(name)))
        total = len(children)
        for found in children.values():
            total += self._below(self._composed(found))
        self._counts[sites] = total
        return total

    def _child_names(self, site: Site) -> list[str]:
        names: dict[str, None] = {}
        for name in self._stack(site[0]):
            spec = self._layers[name].layer.GetObjectAtPath(site[1])
            if spec is not None:
                prim = spec.primSpec if isinstance(spec, Sdf.VariantSpec) else spec
                names.update(dict.fromkeys(prim.nameChildren.keys()))
        return list(names)

    def _composed(self, sites: list[Site]) -> tuple[Site, ...]:
        """The sites and everything that their fields bring in, strongest first."""
        found: dict[Site, list[Site]] = {}
        pending = list(reversed(sites))
        choices: dict[str, str] = {}
        while pending:
            site = pending.pop()
            if site in found:
                continue
            found[site] = list(self._arcs(site, choices))
            if len(found) > MAX_SITES:
                raise RejectedScene("scene-too-large", "A prim is composed of too many places.")
            pending.extend(reversed(found[site]))
        if sum(_ways(site, found, {}) for site in sites) > MAX_WAYS:
            raise RejectedScene("scene-too-large", "A prim is composed of the same places in too many ways.")
        return tuple(found)

    def _arcs(self, site: Site, choices: dict[str, str]) -> Iterator[Site]:
        stack, path = site
        for name in self._stack(stack):
            content = self._layers[name]
            if path not in content.composing:
                continue
            spec = content.layer.GetObjectAtPath(path)
            prim = spec.primSpec if isinstance(spec, Sdf.VariantSpec) else spec
            for key, value in dict(prim.variantSelections).items():
                choices.setdefault(key, value)
            for paths in (prim.inheritPathList, prim.specializesList):
                yield from ((stack, target) for target in paths.GetAddedOrExplicitItems())
            for variant_set in list(prim.variantSets):
                if choices.get(variant_set.name):
                    yield stack, path.AppendVariantSelection(variant_set.name, choices[variant_set.name])
            for arcs in (prim.referenceList, prim.payloadList):
                for arc in arcs.GetAddedOrExplicitItems():
                    target = self._target(stack, name, arc.assetPath, arc.primPath)
                    if target is not None:
                        yield target

    def _target(self, stack: str, layer: str, asset: str, path: Sdf.Path) -> Site | None:
        name = self._resolve(layer, asset) if asset else stack
        if name is None:
            return None
        if path.isEmpty:
            default = self._layers[name].layer.GetDefaultPrimAsPath()
            return None if default.isEmpty else (name, default)
        return name, path

    def _stack(self, name: str) -> tuple[str, ...]:
        """A layer and all its sublayers, strongest first."""
        if name not in self._stacks:
            found: dict[str, None] = {}
            pending = [name]
            while pending:
                layer = pending.pop()
                if layer in found:
                    continue
                found[layer] = None
                below = [self._resolve(layer, path) for path in self._layers[layer].layer.subLayerPaths]
                pending.extend(reversed([path for path in below if path is not None]))
            self._stacks[name] = tuple(found)
        return self._stacks[name]


def _ways(site: Site, arcs: dict[Site, list[Site]], known: dict[Site, int]) -> int:
    """How many ways lead from a site to what it brings in, itself included."""
    if site not in known:
        known[site] = 0  # USD leaves cycles out
        known[site] = 1 + sum(_ways(target, arcs, known) for target in arcs.get(site, ()))
    return known[site]
