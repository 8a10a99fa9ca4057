"""Models of the Solar System: what acts besides Newton's attraction of Sun and planets, with the constants of DE440."""
