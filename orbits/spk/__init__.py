"""Runs as SPK kernels, the ephemeris files of NASA's SPICE, which jplephem, Skyfield and astropy read too."""

from orbits.spk.writing import SpkFile, write

__all__ = ["SpkFile", "write"]
