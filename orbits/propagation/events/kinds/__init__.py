"""The kinds of events: what can be sought."""
