"""`@kernel`, the only way this package compiles a function, and the cache of what it compiles."""

from orbits.kernels.compile.decorator import cpu_features, cpu_name, kernel

__all__ = ["cpu_features", "cpu_name", "kernel"]
