"""Clocks: when the steps of a run are."""
