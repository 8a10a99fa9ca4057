"""Collisions: where bodies touch within a step, and what becomes of them."""
