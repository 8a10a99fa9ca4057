"""The steps of rigid bodies."""
