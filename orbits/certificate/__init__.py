"""Certificates: what an integrator declares, measured on an actual problem."""

from orbits.certificate.certifying import certify
from orbits.certificate.values import Certificate, Finding

__all__ = ["Certificate", "Finding", "certify"]
