"""The search for events: for zeros of functions along a motion, and whether these mean anything."""
