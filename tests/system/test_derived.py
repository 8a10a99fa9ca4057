"""What is computed of a system, once."""

import pickle

import orbits
from orbits.propagation.checks.kepler_splitting import unfit
from orbits.system.derived import derived


def test_what_is_computed_of_a_system_is_computed_once_for_it_and_not_for_its_equals():
    asked = []
    system = orbits.System.solar_system()

    def compute(one):
        asked.append(one)
        return object()

    found = derived(system, compute)
    assert derived(system, compute) is found
    for other in (system.replaced(), pickle.loads(pickle.dumps(system))):
        assert other == system
        assert derived(other, compute) is not found
    assert len(asked) == 3


def test_checks_that_are_made_once_for_a_system_are_found_again_in_each_run():
    planets = {"inner": {"a": 1.0, "e": 0.3, "gm": 1e-4}, "outer": {"a": 1.3, "M": 3.0, "gm": 1e-4}}
    system = orbits.System.from_elements({"star": {"gm": 1.0}, **planets}, units=orbits.DIMENSIONLESS)
    said = [[str(found) for found in unfit(system, orbits.WisdomHolman(), h, 1e3)] for h in (0.1, 0.1, 0.2)]
    assert any("inner and outer" in one for one in said[0])
    assert said[0] == said[1] == said[2]
