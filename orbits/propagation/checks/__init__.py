"""Is a run what it seems? What is looked at before and after it, and said."""
