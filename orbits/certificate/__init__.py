"""Certificates: the properties that an integrator declares, measured on an actual problem."""

from orbits.certificate.certificate import Certificate, Finding
from orbits.certificate.certifying import certify

__all__ = ["Certificate", "Finding", "certify"]
