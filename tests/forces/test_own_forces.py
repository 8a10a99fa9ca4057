"""Forces, terms and methods of users' own: what cannot be marched or archived is refused before the run, in words."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.forces.base import BoundForce, Force
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put
from orbits.system.model import model


@kernel
def force(strength, own, t, q, v, f):
    pass


@kernel
def of_time(strength, own, t, q, v, f):
    put(f, 0, get(f, 0) + t)


@kernel
def of_few(strength, own, q, f):
    pass


@kernel
def particle_force(strength, own, t, particle, sources, speeds, place, velocity):
    return 0.0 * place[0], 0.0 * place[1], 0.0 * place[2]


BOTH = Tag("nothing", {"force": force, "particle_force": particle_force})
ONE = Tag("nothing-on-bodies", {"force": force})
LATE = Tag("something-of-time", {"force": of_time, "particle_force": particle_force})
FEW = Tag("nothing-of-few", {"force": of_few, "particle_force": particle_force})
PLAIN = Tag("nothing-plain", {"force": len, "particle_force": particle_force})


@dataclass(frozen=True)
class Own(Force):
    kind: ClassVar[str] = "own"
    made: Any = None

    def in_units(self, units):
        return self

    def bound(self, massive, particles, units):
        return self.made


@dataclass(frozen=True)
class OwnMethod(orbits.Gauss):
    name: ClassVar[str] = "own-method"


def system(*forces, grain=True):
    names, gm = ["star", "planet", "grain"], [1.0, 1e-3, 0.0]
    q, v = [[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0.0, 0, 0], [0, 1, 0], [0, 0.7, 0]]
    n = 3 if grain else 2
    return orbits.System(names[:n], gm[:n], q[:n], v[:n], units=orbits.DIMENSIONLESS).with_forces(*forces)


NUMBERS = np.array([1.0])
WRONG = {
    "nothing": (None, r"bound\(...\) of Own returns None; expected an orbits.forces.base.BoundForce"),
    "a number": (BoundForce("it", BOTH, 1e-3), "the force 'it': parameters is 0.001, a float; expected a vector"),
    "a list": (BoundForce("it", BOTH, [1e-3]), r"parameters is \[0.001\], a list; expected a vector of floats"),
    "whole numbers": (BoundForce("it", BOTH, np.array([1])), "parameters is .* expected a vector of floats"),
    "no tag": (BoundForce("it", "nothing", NUMBERS), "tag is 'nothing'; expected orbits.kernels.binding.Tag"),
    "no particles": (BoundForce("it", ONE, NUMBERS), "no kernel particle_force for the massless bodies of this system"),
    "arguments": (BoundForce("it", FEW, NUMBERS), r"takes \(strength, own, q, f\); expected force\(strength, own, t"),
    "time": (BoundForce("it", LATE, NUMBERS), r"a kernel of Own reads t, .* expected a method later\(self, time\)"),
    "not compiled": (BoundForce("it", PLAIN, NUMBERS), "force is not compiled; put @orbits.kernel above"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_compiled_code_cannot_take_of_a_force_is_refused_in_words(case):
    made, words = WRONG[case]
    with pytest.raises(InputError, match=words):
        model(system(Own(made=made)))


SETTINGS = ModuleType("settings")
SETTINGS.K = 1.0


@kernel
def of_settings(strength, own, t, q, v, f):
    put(f, 0, get(f, 0) + SETTINGS.K)


def test_a_value_that_changes_between_two_runs_of_one_system_is_refused(monkeypatch):
    """The second run had the code of the first."""
    bodies = system(Own(made=BoundForce("it", Tag("of-settings", {"force": of_settings}), NUMBERS)), grain=False)
    monkeypatch.setattr(SETTINGS, "K", 2.0)
    orbits.propagate(bodies, orbits.Gauss(stages=4), dt=0.1, duration=0.2)
    monkeypatch.setattr(SETTINGS, "K", 3.0)
    with pytest.raises(InputError, match=r"force reads a variable .* has changed since it was first used"):
        orbits.propagate(bodies, orbits.Gauss(stages=4), dt=0.1, duration=0.2)


def test_a_force_says_what_it_is_from_another_origin():
    with pytest.raises(InputError, match="Own does not say what it is from another origin; expected a method"):
        system(Own(made=None)).barycentric()


def test_a_force_needs_no_kernel_for_particles_where_there_are_none():
    made = BoundForce("it", ONE, NUMBERS)
    assert model(system(Own(made=made), grain=False)).forces == (made,)


def test_what_archives_cannot_find_by_name_is_refused_before_the_run(tmp_path):
    path = tmp_path / "run.h5"
    for bodies, method, words in (
        (system(Own(made=BoundForce("it", BOTH, NUMBERS))), orbits.Gauss(), r"Own \('own'\) is not.*orbits/forces/"),
        (system(), OwnMethod(), r"OwnMethod\(stages=8\) \('own-method'\) is not.*orbits/integrators/"),
    ):
        with pytest.raises(InputError, match=f"^archive= finds .* by name .*{words}"):
            orbits.propagate(bodies, method, dt=0.1, duration=1.0, archive=path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("kicks", "drifts"), [(2, 2), (4, 3), (2, 0)])
def test_kicks_and_drifts_of_another_number_are_refused(kicks, drifts):
    """They would be read and written beyond the arrays of a step."""
    form = Splitting(lambda h: (h * np.ones(kicks), h * np.ones(drifts)), drifts=1)
    with pytest.raises(InputError, match=f"lengths of {kicks} kicks and {drifts} drifts; expected 2 kicks and the 1 d"):
        form.coefficients(0.1, 0.1)
