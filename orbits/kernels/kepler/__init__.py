"""The flow of Kepler's problem."""
