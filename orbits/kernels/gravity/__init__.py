"""What acts on bodies: pair sums of gravity, terms and forces, potentials."""
