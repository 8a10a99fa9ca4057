"""Attacks: what a lost machine, a full disk, a second process or a hostile file does to a run.

Each attack has a short form that `make test` runs and a long one, marked `faults`, that `make faults` runs.
"""
