"""The steps of Wisdom–Holman maps."""
