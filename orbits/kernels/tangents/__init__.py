"""Tangent vectors: the exact derivatives of steps and of their stages."""
