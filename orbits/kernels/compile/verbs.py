"""`@verb`: functions of compiled code whose code depends on the types of their arguments.

The decorated function is called by Numba, while it compiles a caller, with the types of the arguments; it returns the
function to compile for them, or None to refuse them. Its docstring says what the compiled function does.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from numba.extending import overload

Choice = TypeVar("Choice", bound=Callable[..., Any])

INLINED: Any = {"forceinline": True, "error_model": "numpy", "_nrt": False}
"""Options for functions that only lead to a kernel: they are inlined into their caller. As separate functions they
would pass registers through memory.
"""


def verb(choose: Choice, options: Any = INLINED) -> Choice:
    """Return the function to call in compiled code; called from Python, it raises NotImplementedError.

    choose : returns the code for the types of the arguments; options : Numba's options for that code
    """

    @wraps(choose)
    def called(*_: Any, **__: Any) -> Any:
        raise NotImplementedError(f"{called.__name__}() is for compiled code only")

    overload(called, jit_options=options)(choose)
    return called  # type: ignore[return-value]
