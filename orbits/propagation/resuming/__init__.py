"""Runs that go on, or are marched again: from archives, checkpoints and samples."""
