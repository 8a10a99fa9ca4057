"""What a user sees of a run on its way, and how it is ended: progress, signals, limits of time."""
