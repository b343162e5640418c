"""Native instances that look the same, so that thousands of them are walked once."""

from __future__ import annotations

from collections.abc import Hashable

from pxr import Sdf, Usd, UsdGeom, UsdSkel

INHERITED = ("primvars:", "material:binding", "purpose", "skel:")
"""Beginnings of the names of properties that decide how prims further down look."""
COLLECTIONS = "material:binding:collection"
"""These bind by path: two instances of one prototype may be bound differently."""


class Likeness:
    """Tells which native instances look the same apart from where they stand."""

    def __init__(self) -> None:
        self._above: dict[Sdf.Path, tuple[Hashable, ...] | None] = {}
        self._resets: dict[Sdf.Path, bool] = {}

    def key(self, root: Usd.Prim) -> Hashable | None:
        """A key that instances share if they look the same; None if `root` has to be looked at by itself.

        It consists of the prototype and of every opinion from which something inside may inherit.

        Args:
            root: An instance that is not inside of another one.
        """
        if root.IsA(UsdGeom.Gprim) or root.IsA(UsdGeom.PointInstancer):
            return None
        prototype = root.GetPrototype()
        above, own = self._inherited(root.GetParent()), _opinions(root)
        if above is None or own is None or self._leaves(prototype) or UsdSkel.Root.Find(root.GetParent()):
            return None
        return prototype.GetPath(), own, above

    def _inherited(self, prim: Usd.Prim) -> tuple[Hashable, ...] | None:
        """Opinions on a prim and all above it; None if some of them bind by path."""
        path = prim.GetPath()
        if prim.IsPseudoRoot():
            return ()
        if path not in self._above:
            above, own = self._inherited(prim.GetParent()), _opinions(prim)
            self._above[path] = None if above is None or own is None else above + own
        return self._above[path]

    def _leaves(self, prototype: Usd.Prim) -> bool:
        """Whether something in a prototype does not move with its instances."""
        path = prototype.GetPath()
        if path not in self._resets:
            prims = Usd.PrimRange(prototype, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
            self._resets[path] = any(
                UsdGeom.Xformable(prim).GetResetXformStack() for prim in prims if prim.IsA(UsdGeom.Xformable)
            )
        return self._resets[path]


def _opinions(prim: Usd.Prim) -> tuple[Hashable, ...] | None:
    """Where each property that others inherit is authored, layer by layer; None if some bind by path."""
    names = [name for name in prim.GetAuthoredPropertyNames() if name.startswith(INHERITED)]
    if any(name.startswith(COLLECTIONS) for name in names):
        return None
    stacks = (prim.GetProperty(name).GetPropertyStack() for name in names)
    return tuple((spec.layer.identifier, spec.path) for stack in stacks for spec in stack)
