"""Samples change nothing: events that end a run are where they are without samples on the way."""

import numpy as np
import pytest
from astropy import units as u

import orbits

METHODS = {
    "stormer-verlet": (orbits.StormerVerlet(), 5 * u.day),
    "gauss": (orbits.Gauss(stages=3), 12 * u.day),
    "wisdom-holman": (orbits.WisdomHolman(), 8 * u.day),
    "standard kick": (orbits.WisdomHolman(kernel="standard", corrector=0), -8 * u.day),
    "transformed time": (orbits.Gauss(stages=4), orbits.TimeTransformed(step=0.2)),
    "chosen steps": (None, None),
}


def planets(massless: bool) -> orbits.System:
    bodies = {
        "Sun": {"mass": 1 * u.M_sun},
        "a": {"a": 1 * u.au, "e": 0.3, "M": 0.4 * u.rad, "mass": 1e-4 * u.M_sun},
        "b": {"a": 2.2 * u.au, "e": 0.2, "M": 1 * u.rad, "mass": 1e-5 * u.M_sun},
    }
    asteroid = {"c": {"a": 3.1 * u.au, "e": 0.1, "M": 2 * u.rad}}
    return orbits.System.from_elements(bodies | (asteroid if massless else {}))


@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
@pytest.mark.parametrize("name", METHODS)
def test_an_event_that_ends_a_run_is_at_the_same_bits_with_any_samples(name):
    method, dt = METHODS[name]
    sign = -1.0 if name == "standard kick" else 1.0
    found = []
    for samples in (2, 37, 101):
        run = orbits.propagate(
            planets(name != "transformed time"), method, dt=dt, duration=sign * 500 * u.day, samples=samples,
            events=[orbits.events.Pericentre("a", then="stop"), orbits.events.Apocentre("a")],
        )  # fmt: skip
        assert run.stopped is not None
        at = run.stopped.system.values
        found.append((run.stopped.time.value, at.q, at.v, run.events.time.value.tobytes()))
    time, *state, times = found[0]
    for other, *there, its_times in found[1:]:
        assert other == time
        assert all(np.array_equal(x, y) for x, y in zip(state, there, strict=True))
        assert its_times == times
