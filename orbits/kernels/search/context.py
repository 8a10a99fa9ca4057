"""The data of observers of a block of steps, in memory that compiled code can read.

An observer gets one number, the *context*: the address of a row of words written by Python. Its fields:

path : flat; n bodies' q and v at the beginning of each step and at the end, each padded to `stride`
stride : length of a padded vector
bodies : n
first : steps taken before this block
origin : reading of the clock at which this block begins, and pace : by how much it grows in a unit of time, where steps
    differ in length: 1, but 1 / h for a particle with steps of its own among constant steps of h
times : times, since `origin`, at which its steps begin and the last one ends; empty if all steps have the same length
dominant : the body that dominates the motion of the others, or -1
mu : its GM
annuli : (n, 3), see `record.py`
reaches : (n + padding,), the distance from each body within which flybys are listed; 0 if no body dominates
record : (4, 2, rows + 8) squared distance, reading of the clock, squared speed and partner of the closest
    approaches
stops : (conditions, 4), see `stopping.py`; these, and `speeds`, if there are any
speeds : (n + padding,), room for the largest speeds of the bodies in a block
hits : (groups + 1,) int64; for each group of eight particles, and last for the bodies: the number of steps in the last
    of which a pair may first come to its bound
every : whether massive bodies are looked at in every step: their orbits may change between two samples
radii : (n + m + padding,), radii of the bodies, then of the particles; negative where nothing collides. These and
    `strength`, `touched`, `touched_own` only if collisions are sought
strength : (1 + n,), the squared softening length and GM of the bodies
touched : (m + 1,) int64; for each particle, and last for the bodies: the number of steps after which one may have
    touched a body
rough : see `orbits.kernels.search.collisions`
touched_own : (m,) int64; the same for each particle that was observed in steps of its own, and 0 for the others
passage_angle : angle of a step, h x speed / distance, above which every passage of a body other than the dominant one
    is listed
least_eccentricity, pericentre_angle : eccentricity and angle of a step above which pericentres about the dominant body
    are listed
passages : (room, columns), see `record.py`: the passages of this block that are listed
listed : (2,) int64; the number of passages in the list, and the number found
search, enter : addresses of `approach_search.search` and `encounters.enter_passage`, shared by the searches among
    bodies and particles, so that each is compiled once
then, collide : addresses of the observers called after `follow_particles`, or 0

A kernel reads them as attributes of `watch_at(context)`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from ctypes import addressof, c_char
from itertools import accumulate
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, register_model
from numpy.typing import NDArray

from orbits.kernels.lanes import WIDTH

INT64, DOUBLE = ir.IntType(64), ir.DoubleType()


def _array(dimensions: int, dtype: Any = types.float64) -> Any:
    return types.Array(dtype, dimensions, "C")


_KINDS: dict[str, Any] = {
    "path": _array(1),
    "stride": types.int64,
    "bodies": types.int64,
    "first": types.int64,
    "origin": types.float64,
    "pace": types.float64,
    "times": _array(1),
    "dominant": types.int64,
    "mu": types.float64,
    "annuli": _array(2),
    "reaches": _array(1),
    "record": _array(3),
    "stops": _array(2),
    "speeds": _array(1),
    "hits": _array(1, types.int64),
    "every": types.int64,
    "radii": _array(1),
    "strength": _array(1),
    "touched": _array(1, types.int64),
    "touched_own": _array(1, types.int64),
    "rough": types.float64,
    "passage_angle": types.float64,
    "least_eccentricity": types.float64,
    "pericentre_angle": types.float64,
    "passages": _array(2),
    "listed": _array(1, types.int64),
    "search": types.int64,
    "enter": types.int64,
    "then": types.int64,
    "collide": types.int64,
}
"""The fields of a context. A number takes one word; an array takes its address and the length of each dimension."""

_ARRAYS = {
    name: (np.dtype(np.int64 if kind.dtype == types.int64 else np.float64), kind.ndim)
    for name, kind in _KINDS.items()
    if isinstance(kind, types.Array)
}
_LENGTHS = {name: 1 + kind.ndim if isinstance(kind, types.Array) else 1 for name, kind in _KINDS.items()}
_FIRST = dict(zip(_KINDS, accumulate(_LENGTHS.values(), initial=0), strict=False))
_PLACES: dict[str, Any] = {
    name: slice(at, at + _LENGTHS[name]) if name in _ARRAYS else at for name, at in _FIRST.items()
}
WORDS = sum(_LENGTHS.values())
"""Words of 8 bytes in a context."""


class WatchType(types.Type):
    """The Numba type of the result of `watch_at`: an address whose attributes are the fields of the context there."""

    def __init__(self) -> None:
        super().__init__(name="Watch")


_WATCH = WatchType()


@register_model(WatchType)
class _WatchModel(PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, INT64)


@infer_getattr
class _WatchFields(AttributeTemplate):
    key = WatchType

    def generic_resolve(self, value, attribute):
        return _KINDS.get(attribute)


@lower_getattr_generic(WatchType)
def _load_field(cx, builder, watch, value, name):
    words, kind, place = builder.inttoptr(value, INT64.as_pointer()), _KINDS[name], _FIRST[name]

    def word(at):
        return builder.load(builder.gep(words, [INT64(at)]))

    if not isinstance(kind, types.Array):
        return builder.bitcast(word(place), DOUBLE) if kind == types.float64 else word(place)
    data = builder.inttoptr(word(place), cx.get_data_type(kind.dtype).as_pointer())
    return _made(cx, builder, kind, data, [word(place + 1 + k) for k in range(kind.ndim)])


def _made(cx, builder, kind, data, shape):
    """Return a contiguous array of 8-byte numbers that owns no memory."""
    from numba.np.arrayobj import populate_array  # for compiling only: processes that load their kernels need no import

    strides = [INT64(8)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    array = cx.make_array(kind)(cx, builder)
    populate_array(array, data, shape, strides, 8, None)
    return array._getvalue()


@intrinsic
def watch_at(typingctx, context):
    """Return the fields at an address, as attributes that are loaded on use."""
    return _WATCH(types.int64), lambda cx, builder, sig, args: args[0]


@intrinsic
def flat(typingctx, array):
    """Return the rows of a contiguous array of two dimensions, one after the other."""
    if not (isinstance(array, types.Array) and array.ndim == 2 and array.layout == "C"):
        return None
    kind = _array(1, array.dtype)

    def codegen(cx, builder, sig, args):
        rows = cx.make_array(sig.args[0])(cx, builder, args[0])
        length = builder.mul(*cgutils.unpack_tuple(builder, rows.shape, 2))
        return _made(cx, builder, kind, rows.data, [length])

    return kind(array), codegen


@intrinsic
def no_particles(typingctx):
    """Return an empty array, for the states of no particles."""
    kind = _array(2)

    def codegen(cx, builder, sig, args):
        return _made(cx, builder, kind, builder.inttoptr(INT64(0), DOUBLE.as_pointer()), [INT64(0), INT64(WIDTH)])

    return kind(), codegen


class Contexts:
    """One context for each of the tasks that observe a block in parallel; the arrays in them are kept alive.

    addresses : the addresses of the contexts
    """

    def __init__(self, count: int) -> None:
        self._words = np.zeros((count, WORDS), dtype=np.int64)
        # Single words are written through views of bytes, in a fraction of the time of an array.
        whole, self._starts = self._words.data.cast("B"), range(0, count * WORDS, WORDS)
        self._integers, self._numbers = whole.cast("q"), whole.cast("d")
        self._kept: dict[str, Any] = {}
        self._own: list[tuple[NDArray[np.int64], Any, tuple[int, ...]]] = []  # the places and words of `follow`
        first = self._words.__array_interface__["data"][0]
        self.addresses = [first + 8 * WORDS * k for k in range(count)]

    def __getstate__(self) -> None:
        """Refuse to be copied or pickled: the addresses would still refer to the arrays of the original."""
        raise TypeError("contexts hold addresses and cannot be copied or pickled; make new ones and enter the arrays.")

    def enter(self, **values: Any) -> None:
        """Enter values into all contexts. Raises TypeError for an array of the wrong kind."""
        for name, value in values.items():
            place = _FIRST[name]
            if name not in _ARRAYS:
                cells = self._numbers if _KINDS[name] is types.float64 else self._integers
                for start in self._starts:
                    cells[start + place] = value
            elif self._kept.get(name) is not value:
                for k, word in enumerate(_described(name, value), place):
                    for start in self._starts:
                        self._integers[start + k] = word
                self._kept[name] = value

    def enter_each(self, name: str, arrays: Sequence[NDArray[Any]]) -> None:
        """Enter a separate array into each context."""
        for start, array in zip(self._starts, arrays, strict=True):
            for k, word in enumerate(_described(name, array), start + _FIRST[name]):
                self._integers[k] = word
        self._kept[name] = list(arrays)

    def follow(self, others: Contexts, own: Sequence[Mapping[str, NDArray[Any]]]) -> None:
        """Copy the last of other contexts into these, one into each, except for arrays of their own."""
        if self._kept.get("own") is not own:
            self._own = [
                (row, _PLACES[name], _described(name, array))
                for row, arrays in zip(self._words, own, strict=True)
                for name, array in arrays.items()
            ]
        self._words[:] = others._words[len(others._words) - len(self._words) :]
        for row, places, words in self._own:
            row[places] = words
        self._kept = {"others": others, "own": own}

    def share(self, others: Contexts, own: Sequence[str]) -> None:
        """Copy the first of other contexts into all of these, except for the fields `own`."""
        shared = np.ones(WORDS, dtype=bool)
        for name in own:
            shared[_PLACES[name]] = False
        self._words[:, shared] = others._words[0, shared]
        self._kept.update({name: arrays for name, arrays in others._kept.items() if name not in own})


def _described(name: str, array: NDArray[Any]) -> tuple[int, ...]:
    """Return the words that describe an array."""
    expected, dimensions = _ARRAYS[name]
    if array.dtype != expected or array.ndim != dimensions or not array.flags.c_contiguous:
        raise TypeError(
            f"{name} must be a contiguous array of {dimensions} dimensions of {expected}, got "
            f"{array.ndim} of {array.dtype}"
        )
    # In a quarter of the time that NumPy takes to tell the address.
    return addressof(c_char.from_buffer(array.data)) if array.size else 0, *array.shape
