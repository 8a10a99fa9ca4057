"""Stages of Wisdom–Holman maps, for planets and for massless particles."""
