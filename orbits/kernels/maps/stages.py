"""The stages of Wisdom–Holman maps, of which their steps and correctors are sequences: rows (kind, length)."""

DRIFT, STANDARD, MODIFIED, LAZY, FLOW = 0, 1, 2, 3, 4
"""In Jacobi coordinates: Kepler motions; a kick by the interaction, plain, modified or at displaced places, with terms
of positions alone; the flow of other terms."""

HELIOCENTRIC_DRIFT, HELIOCENTRIC_KICK = 5, 6
"""In democratic heliocentric coordinates: Kepler motions; a kick with the motion by that of the dominant body."""
