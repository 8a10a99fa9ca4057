"""Runs as SPK kernels: ephemeris files for NASA's SPICE, jplephem, Skyfield and astropy."""

from orbits.spk.writing import SpkFile, write

__all__ = ["SpkFile", "write"]
