"""The compiled loops over steps, and the memory that they use."""
