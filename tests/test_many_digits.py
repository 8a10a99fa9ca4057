"""Many digits, by one thread at a time: the precision of mpmath is that of the process."""

from pathlib import Path
from threading import Event, Thread

import mpmath

import orbits
from orbits.many_digits import many_digits


def test_another_thread_does_not_change_the_digits_of_a_computation():
    # In the first call of a process with several threads, coefficients came out with 15 digits of 60.
    asked, begun, usual = Event(), Event(), mpmath.mp.dps

    def other():
        asked.set()
        with many_digits(20):
            begun.set()

    thread = Thread(target=other)
    with many_digits(60):
        thread.start()
        asked.wait()
        assert not begun.wait(0.1)
        assert mpmath.mp.dps == 60
    thread.join()
    assert begun.is_set()
    assert mpmath.mp.dps == usual


def test_no_file_sets_the_digits_of_mpmath_by_itself():
    package = Path(orbits.__file__).parent
    setting = [path for path in package.rglob("*.py") if "mpmath.workdps(" in path.read_text()]
    assert setting == [package / "many_digits.py"]
