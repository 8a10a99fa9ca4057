"""Memory for NumPy that ends with a page, and behind it a page that nobody may touch: for processes of their own.

A kernel that reads or writes eight lanes past the end of an array ends a process only where the next page is not its
own, which is rare. Here it always does.
"""

from __future__ import annotations

import ctypes
import mmap
import sys

import numpy as np

SET_HANDLER = 304
"""Place of `PyDataMem_SetHandler` in NumPy's table of functions, which never changes. Source: NEP 49."""

VERSION = 1
NAME = b"mem_handler"
PROT_NONE, READ_WRITE = 0, 3

Make = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
MakeZeros = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
Remake = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
Free = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)


class Handler(ctypes.Structure):
    """PyDataMem_Handler."""

    _fields_ = (
        ("name", ctypes.c_char * 127),
        ("version", ctypes.c_uint8),
        ("ctx", ctypes.c_void_p),
        ("malloc", Make),
        ("calloc", MakeZeros),
        ("realloc", Remake),
        ("free", Free),
    )


libc = ctypes.CDLL(None, use_errno=True)
libc.mmap.restype = ctypes.c_void_p
libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long]
libc.mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
libc.munmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t]

blocks: dict[int, tuple[int, int, int]] = {}
"""Of each array the address where its pages begin, the length of these, and its own."""


def make(_ctx: object, size: int) -> int:
    """Return the address of zeros, a multiple of eight, whose last page ends less than eight bytes behind them."""
    page = mmap.PAGESIZE
    length = max(-(-size // page), 1) * page
    begin = libc.mmap(None, length + page, READ_WRITE, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, -1, 0)
    if begin in (None, ctypes.c_void_p(-1).value) or libc.mprotect(begin + length, page, PROT_NONE):
        return 0
    address = (begin + length - size) & ~7
    blocks[address] = begin, length + page, size
    return address


def remake(_ctx: object, address: int | None, size: int) -> int:
    """Return the address of memory with the numbers of another, which is given back."""
    new = make(None, size)
    if address and new:
        ctypes.memmove(new, address, min(size, blocks[address][2]))
        free(None, address, 0)
    return new


def free(_ctx: object, address: int | None, _size: int) -> None:
    """Give memory back."""
    if address:
        begin, length, _ = blocks.pop(address)
        libc.munmap(begin, length)


handler = Handler(
    b"page ends",
    VERSION,
    None,
    Make(make),
    MakeZeros(lambda _ctx, n, size: make(None, n * size)),
    Remake(remake),
    Free(free),
)


def install() -> None:
    """Let the arrays of this thread end with a page from now on, until the process ends by `os._exit`."""
    if not sys.platform.startswith("linux"):
        raise RuntimeError("this is for Linux")
    of_capsule = ctypes.pythonapi.PyCapsule_GetPointer
    of_capsule.restype, of_capsule.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    new_capsule = ctypes.pythonapi.PyCapsule_New
    new_capsule.restype, new_capsule.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    functions = of_capsule(np._core._multiarray_umath._ARRAY_API, None)
    address = ctypes.cast(functions, ctypes.POINTER(ctypes.c_void_p))[SET_HANDLER]
    set_handler = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object)(address)
    set_handler(new_capsule(ctypes.addressof(handler), NAME, None))
    end = np.zeros(13).__array_interface__["data"][0] + 13 * 8
    if end % mmap.PAGESIZE:
        raise RuntimeError("NumPy has taken memory elsewhere")
