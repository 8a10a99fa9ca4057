"""Tags: what stands for the kernels of a Lagrangian, a term, a force or a method in compiled code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

from numba import types
from numba.core.datamodel.models import OpaqueModel
from numba.core.imputils import lower_constant
from numba.extending import NativeValue, register_model, unbox

from orbits.kernels.compile.frozen import frozen_of

_KERNELS: dict[str, Mapping[str, Any]] = {}


class Tag:
    """A Lagrangian as compiled code sees it.

    name : unique; a hash of what is not of this package is added when it is first used
    kernels : its kernels, by the names of the functions of `orbits.kernels.binding`
    """

    def __init__(self, name: str, kernels: Mapping[str, Any]) -> None:
        self._given, self._kernels, self._own = name, dict(kernels), ""

    @cached_property
    def name(self) -> str:
        """The name, from its first use on: what kernels read from around them may change before."""
        self._own = frozen_of(self._kernels)
        name = f"{self._given}-{self._own}" if self._own else self._given
        _KERNELS[name] = self._kernels
        return name

    @cached_property
    def type(self) -> Any:
        """The type by which compiled code finds the kernels."""
        return TagType(self.name)

    @cached_property
    def _numba_type_(self) -> Any:
        return self.type

    def check(self) -> None:
        """Raise InputError if the kernels read values that have changed since they were first used."""
        if self.name and self._own:
            frozen_of(self._kernels)

    def provides(self, name: str) -> bool:
        """Whether the Lagrangian has the kernel of that name."""
        return name in self._kernels

    def __repr__(self) -> str:
        return f"Tag({self.name!r})"


class SumTag(Tag):
    """A sum of terms as compiled code sees it: the first writes, the others add.

    forces : the forces without a Lagrangian (see `orbits.kernels.gravity.terms_and_forces`)
    """

    def __init__(self, terms: Sequence[Tag], forces: Sequence[Tag] = ()) -> None:
        self.terms, self.forces = tuple(terms), tuple(forces)
        self.name = " + ".join(term.name for term in self.terms)
        if self.forces:
            self.name += f", with {' and '.join(force.name for force in self.forces)}"
        self.type = SumType(tuple(term.type for term in self.terms), tuple(force.type for force in self.forces))
        self._numba_type_ = self.type

    def check(self) -> None:
        """Raise InputError as the terms and forces do."""
        for tag in (*self.terms, *self.forces):
            tag.check()

    def provides(self, name: str) -> bool:
        """Whether all terms have the kernel of that name."""
        return all(term.provides(name) for term in self.terms)


class TagType(types.Type):
    """The Numba type of a `Tag`, keyed by its name."""

    def __init__(self, tag: str) -> None:
        super().__init__(name=f"Tag({tag})")
        self.tag = tag


class SumType(types.Type):
    """The Numba type of a `SumTag`, keyed by the types of its terms and forces."""

    def __init__(self, terms: tuple[TagType, ...], forces: tuple[TagType, ...] = ()) -> None:
        acting = f"; {', '.join(force.name for force in forces)}" if forces else ""
        super().__init__(name=f"Sum({', '.join(term.name for term in terms)}{acting})")
        self.terms, self.forces = terms, forces


register_model(TagType)(OpaqueModel)
register_model(SumType)(OpaqueModel)


@unbox(TagType)
@unbox(SumType)
def _unbox_tag(kind, instance, context):
    return NativeValue(context.context.get_dummy_value())


@lower_constant(TagType)
def _constant_tag(context, builder, kind, instance):
    return context.get_dummy_value()


def kernel_of(tag, name):
    """Return the kernel of that name of a tag's Numba type, or None."""
    return _KERNELS[tag.tag][name] if isinstance(tag, TagType) and name in _KERNELS[tag.tag] else None
