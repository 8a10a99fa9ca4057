"""Bodies whose motion is given."""
