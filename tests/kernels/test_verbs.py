"""Functions of compiled code whose code depends on the types of their arguments."""

import inspect

import pytest
from numba import types

from orbits.kernels import binding, steps
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import functions


@verb
def half(x):
    """Return half of an integer, rounded down, or of a float64."""
    if isinstance(x, types.Integer):
        return lambda x: x // 2
    return lambda x: 0.5 * x


@kernel
def halves(m, x):
    return half(m), half(x)


def test_a_verb_has_the_code_that_is_chosen_for_the_types_of_its_arguments():
    assert halves(7, 7.0) == (3, 3.5)


@pytest.mark.parametrize("function", [half, steps.step, binding.field, functions.sin, functions.atan2])
def test_a_verb_called_from_python_is_refused_by_name(function):
    arguments = [0.0] * len(inspect.signature(function).parameters)
    with pytest.raises(NotImplementedError, match=rf"^{function.__name__}\(\) is for compiled code only$"):
        function(*arguments)
    assert function.__doc__.startswith(("Return", "Take"))
