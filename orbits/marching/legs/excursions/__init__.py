"""Encounters that a map does not follow: the bodies leave it, take chosen steps, and return."""
