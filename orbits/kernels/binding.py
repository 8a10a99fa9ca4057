"""How a compiled integrator finds the kernels of a Lagrangian.

A Lagrangian enters compiled code as a tag: a value without content whose *type* names the Lagrangian. Each function
below is resolved at compile time to the kernel that the Lagrangian registered under that name. (A kernel passed as an
argument would never hit Numba's disk cache; a tag does.)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numba import types
from numba.core.datamodel.models import OpaqueModel
from numba.extending import NativeValue, overload, register_model, typeof_impl, unbox

_KERNELS: dict[str, Mapping[str, Any]] = {}


class Tag:
    """The compiled face of a Lagrangian.

    name : unique; where the kernels may change under the same name, it must hold a hash of their source
    kernels : what it provides, by the names of the functions of this module
    """

    def __init__(self, name: str, kernels: Mapping[str, Any]) -> None:
        self.name = name
        self.type = TagType(name)
        _KERNELS[name] = dict(kernels)

    def provides(self, name: str) -> bool:
        """Whether the Lagrangian has the kernel of that name."""
        return name in _KERNELS[self.name]

    def __repr__(self) -> str:
        return f"Tag({self.name!r})"


class TagType(types.Type):
    """The Numba type of a `Tag`, keyed by its name."""

    def __init__(self, tag: str) -> None:
        super().__init__(name=f"Tag({tag})")
        self.tag = tag


@typeof_impl.register(Tag)
def _typeof_tag(value, context):
    return value.type


register_model(TagType)(OpaqueModel)


@unbox(TagType)
def _unbox_tag(kind, instance, context):
    return NativeValue(context.context.get_dummy_value())


def kernel_of(tag, name):
    """Return the kernel of that name of a tag's Numba type, or None."""
    return _KERNELS[tag.tag][name] if isinstance(tag, TagType) and name in _KERNELS[tag.tag] else None


def dimension(lagrangian, parameters):
    """Return the number of coordinates."""
    raise NotImplementedError("dimension() is for compiled code only")


@overload(dimension)
def _dimension(lagrangian, parameters):
    compiled = kernel_of(lagrangian, "dimension")
    if isinstance(compiled, int):
        return lambda lagrangian, parameters: compiled
    return compiled and (lambda lagrangian, parameters: compiled(parameters))


def bodies(lagrangian, parameters):
    """Return the number of bodies of three coordinates each, all x first; 0 where coordinates do not form bodies."""
    raise NotImplementedError("bodies() is for compiled code only")


@overload(bodies)
def _bodies(lagrangian, parameters):
    compiled = kernel_of(lagrangian, "bodies")
    return (lambda lagrangian, parameters: compiled(parameters)) if compiled else (lambda lagrangian, parameters: 0)


def value(lagrangian, parameters, t, q, v):
    """Return L(q, v, t): float64 for vectors, `Lanes` for rows of eight stages (t is then `Lanes`)."""
    raise NotImplementedError("value() is for compiled code only")


@overload(value)
def _value(lagrangian, parameters, t, q, v):
    compiled = kernel_of(lagrangian, "value")
    return compiled and (lambda lagrangian, parameters, t, q, v: compiled(parameters, t, q, v))


def gradients(lagrangian, parameters, t, q, v, f, p):
    """Write dL/dq(q, v, t) into f and dL/dv(q, v, t) into p; vectors, or rows of eight stages with t in `Lanes`."""
    raise NotImplementedError("gradients() is for compiled code only")


@overload(gradients)
def _gradients(lagrangian, parameters, t, q, v, f, p):
    compiled = kernel_of(lagrangian, "gradients")
    return compiled and (lambda lagrangian, parameters, t, q, v, f, p: compiled(parameters, t, q, v, f, p))


def hessians(lagrangian, parameters, t, q, v, out):
    """Write d2L/dq dq, d2L/dq dv and d2L/dv dv, each d x d row by row, into `out`: 3 d^2 elements or rows."""
    raise NotImplementedError("hessians() is for compiled code only")


@overload(hessians)
def _hessians(lagrangian, parameters, t, q, v, out):
    compiled = kernel_of(lagrangian, "hessians")
    return compiled and (lambda lagrangian, parameters, t, q, v, out: compiled(parameters, t, q, v, out))


def accelerate(lagrangian, parameters, q, out):
    """Write the accelerations g(q) of all coordinates into `out`; padded vectors (d + 8,), or rows of eight stages."""
    raise NotImplementedError("accelerate() is for compiled code only")


@overload(accelerate)
def _accelerate(lagrangian, parameters, q, out):
    compiled = kernel_of(lagrangian, "accelerate" if getattr(q, "ndim", 0) == 1 else "accelerate_stages")
    return compiled and (lambda lagrangian, parameters, q, out: compiled(parameters, q, out))


def accelerate_some(lagrangian, parameters, q, out, start, stop):
    """Write what `accelerate` would, bit for bit, of bodies start ... stop - 1 only, start being a multiple of 8."""
    raise NotImplementedError("accelerate_some() is for compiled code only")


@overload(accelerate_some)
def _accelerate_some(lagrangian, parameters, q, out, start, stop):
    compiled = kernel_of(lagrangian, "accelerate_some")
    return compiled and (lambda lagrangian, parameters, q, out, start, stop: compiled(parameters, q, out, start, stop))


def field(lagrangian, parameters, sources, x, y, z):
    """Return the acceleration (ax, ay, az) of a massless particle at (x, y, z) in the field of `sources`."""
    raise NotImplementedError("field() is for compiled code only")


@overload(field)
def _field(lagrangian, parameters, sources, x, y, z):
    compiled = kernel_of(lagrangian, "field")
    return compiled and (lambda lagrangian, parameters, sources, x, y, z: compiled(parameters, sources, x, y, z))
