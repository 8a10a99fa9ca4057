"""What operators return, looked up once for each combination of types.

Numba asks some twenty rules in turn for the type of each a + b, first those for strings, sets and arrays: that took a
tenth of the time of compiling. It uses private parts of Numba, as the cache does; pyproject.toml pins the tested range
of versions.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from numba import types
from numba.core.typing.context import Context


class RememberingContext(Context):
    """Numba's typing context, that remembers what operators return.

    context : of Numba; both have one state
    """

    _found: dict[Any, Any]

    def __init__(self, context: Context) -> None:
        # Not Numba's own: nothing is set up again.
        self.__dict__ = context.__dict__
        self._found = {}

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call of a function with arguments of these types."""
        called = func if isinstance(func, types.Function) else self._lookup_global(func)
        if kws or not isinstance(called, types.Function) or not _is_operator(called.typing_key):
            return super().resolve_function_type(func, args, kws)
        key = called, args  # whoever teaches Numba more of an operator makes another `called`
        if key not in self._found:
            self._found[key] = super().resolve_function_type(func, args, kws)
        return self._found[key]


def _is_operator(function: Any) -> bool:
    """Whether the types of the arguments determine the compiled code of a function, whatever options callers have."""
    return function is bool or getattr(function, "__module__", None) == "_operator"


@lru_cache(maxsize=4)
def remembering(context: Context) -> RememberingContext:
    """Return the context that remembers what operators return, for one of Numba's."""
    return RememberingContext(context)
