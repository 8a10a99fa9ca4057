"""Tangent vectors that follow a march."""
