"""Archives: runs in HDF5 files that survive an interruption at any point, and are resumed bit for bit.

The schema is described for readers with plain h5py in docs/archive.md.
"""

from typing import TYPE_CHECKING

from orbits.later import later

if TYPE_CHECKING:
    from orbits.archive.reader import Archive
    from orbits.archive.writer import ArchiveWriter, extended

__all__ = ["Archive", "ArchiveWriter", "extended"]

__getattr__ = later(
    __name__, {"orbits.archive.reader": ["Archive"], "orbits.archive.writer": ["ArchiveWriter", "extended"]}
)
