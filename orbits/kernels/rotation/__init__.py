"""The free rotation of rigid bodies, and spins in the plane of an orbit."""
