"""`python -m orbits` is the command `orbits`."""

from orbits.cli import main

if __name__ == "__main__":
    main()
