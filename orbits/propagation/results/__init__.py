"""What a run answers with: closest approaches, error bars, states at any time."""
