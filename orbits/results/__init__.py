"""The values that a run answers with: they say what they are, and `orbits.propagation` computes them."""
