"""What observes a march: approaches, encounters, conditions."""
