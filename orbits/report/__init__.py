"""What a comparison found: rows, a table to read, JSON for machines, a picture for a talk, and a verdict.

A `Report` is a value made by `orbits.compare`; it knows numbers and names only, not how they were computed.
"""

from orbits.report.values import Report, Row, Series, YardstickNote

__all__ = ["Report", "Row", "Series", "YardstickNote"]
