"""The march over steps: its loop, clocks, threads, observers and results."""
