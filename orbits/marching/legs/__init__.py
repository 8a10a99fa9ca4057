"""Legs: a march of the same bodies by one method and one clock, and what looks at its blocks."""
