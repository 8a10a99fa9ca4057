"""The loop that marches: driver, threads, observers, and what a march gives back."""
