"""Whether the kernels of a Lagrangian are derivatives of one another: gradients those of value, hessians those of
gradients.

All other measurements take this for granted: they compare steps with solutions that come from the same kernels. Terms
of a sum are compared one by one, so that a small one is not lost in the rounding of large ones.

Derivatives are central differences of halved spans, extrapolated, with the doubt that extrapolation and rounding leave.
Source: Ridders (1982), Advances in Engineering Software 4, 75.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.certificate.measuring import EPS, Measured
from orbits.kernels.binding import SumTag
from orbits.lagrangians import evaluation
from orbits.lagrangians.base import Lagrangian, show

Array = NDArray[np.float64]

SPAN = 0.2137
"""The first half span of a difference, in units of the coordinate: no simple fraction of a period."""

HALVINGS, LEAST, LEVELS = 40, 6, 6
"""The most spans that are tried, the least, and the largest number of extrapolations."""

ROUNDING = 2.0
"""What a difference may be wrong by from rounding, in units of that of all that is added up in a kernel."""

DOUBTS = 128.0
"""How many times its doubt a difference may be wrong by: the best of some sixty is close to others by chance."""

FURTHER = 256.0
"""How many times the best doubt the rounding is at the shortest span: shorter ones show nothing more, if those before
were shorter than the distances of bodies."""


class Part(NamedTuple):
    """A Lagrangian, or a term of a sum by its number, as functions of x = (q, v), (2d,), in the order of kernels."""

    lagrangian: Lagrangian
    number: int | None

    def value(self, x: Array, t: float) -> Array:
        """Return L, (1,)."""
        return np.array([evaluation.value(*self._at(x, t), self.number)])

    def gradients(self, x: Array, t: float) -> Array:
        """Return dL/dq and dL/dv, (2d,)."""
        return np.concatenate(evaluation.gradients(*self._at(x, t), self.number))

    def hessians(self, x: Array, t: float) -> Array:
        """Return the second derivatives, (2d, 2d)."""
        d = len(x) // 2
        qq, qv, vv = evaluation.hessians(*self._at(x, t), self.number).reshape(3, d, d)
        return np.block([[qq, qv], [qv.T, vv]])

    def variable(self, j: int) -> tuple[str, str]:
        """Return what the derivative is by, q or v, and the name of the coordinate."""
        d, order = self.lagrangian.dimension, self.lagrangian.order
        return "qv"[j // d], self.lagrangian.coordinates[j % d if order is None else order[j % d]]

    @property
    def whose(self) -> str:
        """Its name, behind what it has, for messages."""
        summands: Any = getattr(self.lagrangian, "summands", ())
        names = ("Newton's term", *(f"the term {summand.name}" for summand in summands))
        return "" if self.number is None else f" of {names[self.number]}"

    def _at(self, x: Array, t: float) -> tuple[Any, Any, float, Array, Array]:
        d = len(x) // 2
        return self.lagrangian.tag, self.lagrangian.parameter_vector, t, x[:d].copy(), x[d:].copy()


def kernels_agree(
    lagrangian: Lagrangian, states: Iterable[tuple[Array, Array, float]]
) -> Iterator[tuple[str, Measured]]:
    """Yield how far gradients are from differences of value, and hessians from differences of gradients, in units of
    what the differences may be wrong by.

    states : (q, v, t), in the order of callers
    """
    order = lagrangian.kernel_order
    at = [(np.concatenate([order(q), order(v)]), t) for q, v, t in states]
    for name, compare in (("gradients are those of value", _gradients), ("hessians are those of gradients", _hessians)):
        found = [compare(part, x, t) for part in _parts(lagrangian) for x, t in at]
        yield name, max(found, key=lambda measured: measured.value)


def _parts(lagrangian: Lagrangian) -> list[Part]:
    tag = lagrangian.tag
    if not isinstance(tag, SumTag):
        return [Part(lagrangian, None)]
    return [Part(lagrangian, k) for k in range(len(tag.terms))]


def _gradients(part: Part, x: Array, t: float) -> Measured:
    claimed = part.gradients(x, t)
    size = np.abs(part.value(x, t)) + np.abs(claimed) @ np.abs(x)

    def words(_: int, j: int) -> str:
        by, name = part.variable(j)
        return f"dL/d{by} of {name}{part.whose}"

    return _worst(lambda y: part.value(y, t), x, t, claimed[None, :], size, words, "value")


def _hessians(part: Part, x: Array, t: float) -> Measured:
    claimed = part.hessians(x, t)
    size = np.abs(part.gradients(x, t)) + np.abs(claimed) @ np.abs(x)

    def words(i: int, j: int) -> str:
        (by, name), (then, other) = part.variable(i), part.variable(j)
        return f"d2L/d{by} d{then} of {name}, {other}{part.whose}"

    return _worst(lambda y: part.gradients(y, t), x, t, claimed, size, words, "gradients")


def _worst(
    function: Callable[[Array], Array],
    x: Array,
    t: float,
    claimed: Array,
    size: Array,
    words: Callable[[int, int], str],
    kernel: str,
) -> Measured:
    """Return the largest difference of the derivatives of a function (m,) by x from those that are claimed, (m, 2d).

    size : (m,) what is added up in the function; words : for a derivative; kernel : the function, for the message
    """
    d, worst, note = len(x) // 2, 0.0, "central differences, extrapolated"
    apart = np.diff(np.sort(x[:d]))
    closest = float(np.min(apart, initial=np.inf, where=apart > 0.0))  # no more than the distances of bodies
    for j, span in enumerate(_spans(x)):
        with np.errstate(all="ignore"):
            found, doubt = derivative(function, x, j, span, size, closest if j < d else np.inf)
            off = np.abs(claimed[:, j] - found)
            least = EPS * (np.abs(claimed[:, j]) + np.abs(found))
            ratio = np.where(off > 0.0, off / (DOUBTS * np.maximum(doubt, least)), 0.0)
        i = int(np.argmax(ratio))
        if ratio[i] > max(worst, 1.0):
            note = (
                f"{words(i, j)} is {claimed[i, j]:.10g}, but {found[i]:.10g} by differences of {kernel}, at "
                f"q = {show(x[:d])}, v = {show(x[d:])}, t = {t:.6g}"
            )
        worst = max(worst, float(ratio[i]))
    return Measured(worst, 1.0, "of the doubt", note)


def derivative(
    function: Callable[[Array], Array], x: Array, j: int, span: float, size: Array, within: float = np.inf
) -> tuple[Array, Array]:
    """Return the derivative of a function (m,) by x_j and its doubt, each (m,); NaN where no difference is finite.

    span : the first half span; size : (m,) what is added up in the function, whose rounding differences amplify
    within : a span that is tried whatever longer ones show
    """
    found, doubt = np.full(len(size), np.nan), np.full(len(size), np.inf)
    row: list[Array] = []
    for k in range(HALVINGS):
        ahead, behind = x.copy(), x.copy()
        ahead[j] += span * 2.0**-k
        behind[j] -= span * 2.0**-k
        above, below = function(ahead), function(behind)
        rounded = ROUNDING * EPS * np.maximum(size, np.maximum(np.abs(above), np.abs(below))) / (span * 2.0**-k)
        if k >= LEAST and span * 2.0**-k < within and np.all(rounded >= FURTHER * doubt):
            break
        new = [(above - below) / (ahead[j] - behind[j])]
        for i, before in enumerate(row[:LEVELS]):
            new.append(new[i] + (new[i] - before) / (4.0 ** (i + 1) - 1.0))
            off = np.maximum(np.abs(new[i + 1] - new[i]), np.abs(new[i + 1] - before)) + rounded
            # Spans longer than the distance of two bodies agree among themselves without their attraction.
            better = (off < doubt) | (np.abs(new[i + 1] - found) > off + doubt)
            found, doubt = np.where(better, new[i + 1], found), np.where(better, off, doubt)
        row = new
    return found, doubt


def _spans(x: Array) -> Array:
    """Return the first half span for each of q and v, (2d,)."""
    spans = []
    for part in np.split(x, 2):
        size = np.abs(part)
        largest = float(np.max(size))
        spans.append(SPAN * np.where(size > 1e-3 * largest, size, largest if largest > 0.0 else 1.0))
    return np.concatenate(spans)
