"""The step of variational methods in canonical form, for any regular Lagrangian."""
