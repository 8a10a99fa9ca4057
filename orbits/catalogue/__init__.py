"""Catalogues of small bodies: the bundled one, and readers of downloaded files."""

from __future__ import annotations

from orbits.catalogue.bundled import EPOCH_MJD, asteroids
from orbits.catalogue.catalogue import Catalogue
from orbits.catalogue.classes import CLASSES, orbit_classes
from orbits.catalogue.mpcorb import read_mpcorb
from orbits.catalogue.sbdb import read_sbdb

__all__ = ["CLASSES", "EPOCH_MJD", "Catalogue", "asteroids", "orbit_classes", "read_mpcorb", "read_sbdb"]
