"""REBOUND's integrators by name, with the options that each takes: "whfast:kernel=lazy,corrector=17".

A name has REBOUND's defaults unless options follow it. The options are attributes of REBOUND's integrators, with
REBOUND's names and values; dashes and underscores in values may be left out or interchanged.

Source: REBOUND 5.2, `Simulation.integrator`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

from orbits.errors import InputError, UnknownNameError, shown

KERNELS = ("default", "modifiedkick", "composition", "lazy")
CORRECTORS = (0, 3, 5, 7, 11, 17)
COORDINATES = ("jacobi", "democraticheliocentric", "whds", "barycentric")
SABA_TYPES = (
    *("1", "2", "3", "4", "cm_1", "cm_2", "cm_3", "cm_4", "cl_1", "cl_2", "cl_3", "cl_4"),
    *("10_4", "8_6_4", "10_6_4", "h_8_4_4", "h_8_6_4", "h_10_6_4"),
)
PERI_MODES = ("partial_bs", "full_bs", "full_ias15")
ADAPTIVE_MODES = ("individual", "global", "prs23", "aarseth85")

POSITIVE = "a number above 0"
"""Instead of a list of values."""

OPTIONS: dict[str, dict[str, tuple[str, ...] | tuple[int, ...] | str]] = {
    "whfast": {"kernel": KERNELS, "corrector": CORRECTORS, "corrector2": (0, 1), "coordinates": COORDINATES},
    "whfast512": {"corrector": (0, 17)},
    "saba": {"type": SABA_TYPES},
    "mercurius": {"r_crit_hill": POSITIVE},
    "trace": {"r_crit_hill": POSITIVE, "peri_crit_eta": POSITIVE, "peri_mode": PERI_MODES},
    "ias15": {"epsilon": POSITIVE, "adaptive_mode": ADAPTIVE_MODES},
    "leapfrog": {"order": (2, 4, 6, 8)},
}
"""The options of each of REBOUND's integrators, and the values that they take."""


@dataclass(frozen=True)
class Peer:
    """A configuration of REBOUND: its name, settings and limitations.

    name : the name for callers, options included
    integrator : REBOUND's name for the integrator
    options : attributes set on `Simulation.integrator`; everything else has REBOUND's defaults
    fixed_step : whether it uses the given step on the grid t0 + k dt
    keplerian : whether it splits off Kepler orbits about the first body, which must then dominate, without softening
    """

    name: str
    integrator: str
    fixed_step: bool
    keplerian: bool = False
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """The name in tables: `REBOUND whfast`."""
        return f"REBOUND {self.name}"

    @property
    def bundles_steps(self) -> bool:
        """Whether it takes all steps up to a sample in one call, and is synchronized there."""
        return self.integrator == "whfast512"


_UNSYNCHRONIZED = (("safe_mode", 0), ("keep_unsynchronized", 1))

PEERS: dict[str, Peer] = {
    peer.name: peer
    for peer in (
        Peer("whfast", "whfast", True, True, _UNSYNCHRONIZED),
        Peer("whfast-corrector17", "whfast", True, True, (*_UNSYNCHRONIZED, ("corrector", 17))),
        Peer("whfast-heliocentric", "whfast", True, True, (*_UNSYNCHRONIZED, ("coordinates", COORDINATES[1]))),
        Peer("whfast512", "whfast512", True, True),
        Peer("saba", "saba", True, True, _UNSYNCHRONIZED),
        Peer("saba-10-6-4", "saba", True, True, (*_UNSYNCHRONIZED, ("type", "10_6_4"))),
        Peer("mercurius", "mercurius", True, True),
        Peer("trace", "trace", True, True),
        Peer("ias15", "ias15", False),
        Peer("leapfrog", "leapfrog", True),
    )
}
"""Every peer by its name, without options."""


def lookup(name: str) -> Peer:
    """Return the peer of a text such as "whfast" or "whfast:kernel=lazy,corrector=17".

    Raises UnknownNameError with the nearest names for one that does not exist, and InputError for options and values
    that it does not take, or that REBOUND cannot combine.
    """
    text = name.strip().lower() if isinstance(name, str) else ""
    head, colon, options = (part.strip() for part in text.partition(":"))
    peer = PEERS.get(head)
    if peer is None:
        near = get_close_matches(head or str(name), PEERS, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise UnknownNameError(f"no peer is called {shown(head or name)}; there are {', '.join(PEERS)}.{hint}")
    if not colon:
        return peer
    given = _given(peer, head, options)
    chosen = dict(peer.options) | given
    _check_combination(peer, chosen, f"{head}:{_written(given)}")
    return replace(peer, name=f"{head}:{_written(given)}", options=tuple(chosen.items()))


def listed(against: str | Iterable[str]) -> list[Peer]:
    """Return the peers of a text with commas, or of several such texts.

    "whfast:kernel=lazy,corrector=17,ias15" are two: what follows a comma is an option if it has an equals sign before
    any colon, and a part of a value if it is a number, as in "saba:type=10,6,4".

    Raises what `lookup` raises, and InputError for anything but texts and for a peer that is given twice.
    """
    texts = [against] if isinstance(against, str) else against
    if not isinstance(texts, Iterable):
        raise InputError(f"against must be names of peers, such as ['whfast'], or [] for none; got {shown(against)}")
    found: list[Peer] = []
    for text in texts:
        if not isinstance(text, str):
            raise InputError(f"against holds {shown(text)}; expected names of peers, such as 'whfast' or 'ias15'")
        found += [lookup(each) for each in re.split(r",(?!\s*(?:[^,:=]*=|\d+\s*(?:,|$)))", text) if each.strip()]
    labels = [(peer.integrator, sorted(peer.options)) for peer in found]
    for i, peer in enumerate(found):
        if labels[i] in labels[:i]:
            twin = found[labels.index(labels[i])].name
            same = f"is {twin!r} again" if twin != peer.name else "is compared twice"
            raise InputError(f"against: {peer.name!r} {same}; give each peer once.")
    return found


def _given(peer: Peer, head: str, text: str) -> dict[str, Any]:
    """Return the options of a text "kernel=lazy,corrector=17"."""
    known, found = OPTIONS[peer.integrator], dict[str, Any]()
    for piece in re.split(r",(?=[^,=]*=)", text):
        option, equals, value = (part.strip() for part in piece.partition("="))
        if not equals:
            example = next(iter(known))
            what = f"{shown(piece)} is not an option" if option else "an option is missing"
            raise InputError(
                f"{head}: {what}; expected OPTION=VALUE after the colon, such as "
                f"{head}:{example}={_example(known[example])}"
            )
        if option not in known:
            near = get_close_matches(option, known, n=1)
            hint = f" Did you mean {near[0]!r}?" if near else ""
            raise UnknownNameError(f"{head} has no option {shown(option)}; it takes {', '.join(known)}.{hint}")
        if option in found:
            raise InputError(f"{head}: {option} is given twice, as {found[option]} and {value}; expected one.")
        found[option] = _value(head, option, value, known[option])
    return found


def _value(head: str, option: str, text: str, known: tuple[Any, ...] | str) -> Any:
    """Return the value of an option."""
    if isinstance(known, str):
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not 0.0 < number < math.inf:
            raise InputError(f"{head}: {option} is {shown(text)}; expected {known}")
        return number
    if known == (0, 1):
        text = {"false": "0", "true": "1", "off": "0", "on": "1"}.get(text, text)
    values = {_plain(str(each)): each for each in known}
    if _plain(text) not in values:
        raise InputError(f"{head}: {option} is {shown(text)}; expected {', '.join(map(str, known))}")
    return values[_plain(text)]


def _check_combination(peer: Peer, options: dict[str, Any], written: str) -> None:
    """Raise InputError for what REBOUND refuses, or computes without saying that it does not fit."""
    if peer.integrator != "whfast":
        return
    coordinates = options.get("coordinates", "jacobi")
    if coordinates == "jacobi":
        return
    kernel, corrector = options.get("kernel", "default"), options.get("corrector", 0)
    if kernel != "default":
        raise InputError(
            f"{written}: WHFast has kernel={kernel} in Jacobi coordinates only; leave out coordinates={coordinates}, "
            "or take kernel=default"
        )
    if options.get("corrector2"):
        raise InputError(
            f"{written}: WHFast's second corrector is one for Jacobi coordinates; leave out coordinates={coordinates}, "
            "or corrector2"
        )
    if corrector and coordinates == "whds":
        raise InputError(f"{written}: WHFast has no corrector in the coordinates whds; leave out corrector={corrector}")


def _written(options: dict[str, Any]) -> str:
    return ",".join(f"{option}={value:g}" if isinstance(value, float) else f"{option}={value}"
                    for option, value in options.items())  # fmt: skip


def _example(known: tuple[Any, ...] | str) -> str:
    return "1" if isinstance(known, str) else str(known[-1])


def _plain(text: str) -> str:
    """Return a value without what separates its parts: "10-6-4", "10_6_4" and "(10,6,4)" are the same."""
    return re.sub(r"[-_,()\s]", "", text)
