"""Methods by name, and errors for arguments of other packages that name the equivalent."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import orbits
from orbits.errors import InputError, UnknownNameError

PAIR = orbits.System.from_elements({"star": {"gm": 1}, "planet": {"a": 1, "gm": 1e-3}}, units=orbits.DIMENSIONLESS)


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("gauss", orbits.Gauss()),
        ("Gauss(stages=2)", orbits.Gauss(stages=2)),
        ("StormerVerlet", orbits.StormerVerlet()),
        ("stormer_verlet", orbits.StormerVerlet()),
        ("symplectic-euler(variant='Drift-Kick')", orbits.methods.SymplecticEuler(variant="drift-kick")),
        ("composition(StormerVerlet(), order=6, scheme='Yoshida')",
         orbits.methods.Composition(orbits.StormerVerlet(), order=6, scheme="yoshida")),
    ],
)  # fmt: skip
def test_a_method_may_be_given_by_its_name(name, method):
    run = orbits.propagate(PAIR, name, dt=0.05, duration=0.5, samples=3)
    assert run.integrator == method
    assert np.array_equal(run.q, orbits.propagate(PAIR, method, dt=0.05, duration=0.5, samples=3).q)


def test_names_of_methods_are_understood_by_all_that_takes_one():
    pendulum = orbits.lagrangians.pendulum
    path = orbits.march(pendulum, "gauss(stages=2)", dt=0.1, steps=3)
    assert np.array_equal(path.q, orbits.march(pendulum, orbits.Gauss(stages=2), dt=0.1, steps=3).q)
    x = PAIR.values
    by_name = orbits.diagnostics.reversibility(x.gm, x.q, x.v, "stormer-verlet", dt=0.01, steps=10)
    assert by_name == orbits.diagnostics.reversibility(x.gm, x.q, x.v, orbits.StormerVerlet(), dt=0.01, steps=10)
    for ask in (
        lambda name: orbits.propagate(PAIR, name, dt=0.1, duration=1),
        lambda name: orbits.march(pendulum, name, dt=0.1, steps=3),
        lambda name: orbits.certify(PAIR, name, dt=0.1),
        lambda name: orbits.compare(PAIR, name, dt=0.1, duration=1, against=[]),
    ):
        with pytest.raises(UnknownNameError, match=r"'ias15', which is REBOUND's.*Known: composition, .*gauss"):
            ask("ias15")
        with pytest.raises(InputError, match=r"cannot read the integrator '8 stages'"):
            ask("8 stages")
        with pytest.raises(InputError, match=r"must be a method such as orbits.Gauss\(stages=8\), or its name"):
            ask(orbits.Gauss)


@pytest.mark.parametrize(
    ("argument", "answer"),
    [
        ("additional_forces", "what acts besides Newtonian gravity belongs to the system: system.with_terms("),
        ("tmax", "the end of a run is duration=..., or until=..."),
        ("Nout", "the samples to keep are samples=..., a count or times"),
        ("exit_max_distance", "stop=orbits.events.FartherThan(distance) ends a run"),
        ("epsilon", "dt=orbits.Adaptive(tolerance=...) is the tolerance of steps that are chosen"),
        ("sampels", "expected some of system, integrator, dt, duration, until, samples, archive"),
        ("sampels", "Did you mean samples?"),
    ],
)
def test_an_argument_of_another_package_is_answered_with_what_there_is(argument, answer):
    with pytest.raises(UnknownNameError) as caught:
        orbits.propagate(PAIR, "gauss", dt=0.1, duration=1, **{argument: 1})
    assert f"propagate() has no argument {argument!r}" in str(caught.value)
    assert answer in str(caught.value)


def test_the_arguments_of_propagate_are_named_in_its_signature():
    assert {"dt", "duration", "until", "samples"} <= set(inspect.signature(orbits.propagate).parameters)
