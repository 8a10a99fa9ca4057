"""2008 KV42, a short arc, beside the least-squares solution of OpenOrb from the same 15 observations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.elements.frames import icrf_to_ecliptic

STATE = (
    *(-0.86044807940957e01, -0.22621219571978e02, 0.20694272841959e02),
    *(0.26003174187899e-03, 0.33025208187869e-02, 0.10808129096200e-02),
)
"""Heliocentric, ecliptic, au and au/d, at MJD 54636.0 TT: nbody_lsl.txt of oorb/oorb, commit 8d8fa6aa."""

SIGMA = (
    *(0.245810442617314e-01, 0.619658004876702e-01, 0.592755528207080e-01),
    *(0.176491711155499e-03, 0.375307941940390e-03, 0.364482238601972e-03),
)
COVARIANCE = (
    *(0.152317712536052e-02, -0.145704923302347e-02, 0.277578093801063e-05, 0.382028035339568e-05),
    *(-0.397654272338404e-05, -0.367305540368767e-02, 0.697651394687677e-05, 0.957776789007817e-05),
    *(-0.997400977805305e-05, -0.667581292859262e-05, -0.916745818103686e-05, 0.954623343243513e-05),
    *(0.638758790911688e-07, -0.625591719925796e-07, -0.136711890620063e-06),
)


def test_the_orbit_and_its_covariance_are_those_of_openorb():
    epoch = Time(54636.0, format="mjd", scale="tt").tdb
    observations = orbits.Observations.read(Path(__file__).parent / "data" / "K08K42V_lsl.mpc")
    # Without a covariance scaled to residuals, OpenOrb's is that of an arcsecond in each coordinate.
    fit = orbits.fit(observations, orbits.System.in_ephemeris(epoch=epoch), sigma=1 * u.arcsec)
    found = fit.covariance()
    values = found.values - np.concatenate([fit.system.values.q[0], fit.system.values.v[0]])
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = icrf_to_ecliptic(np.eye(3)).T
    matrix = np.diag(np.square(SIGMA))
    matrix[np.triu_indices(6, 1)] = COVARIANCE
    matrix = np.triu(matrix) + np.triu(matrix, 1).T
    # Reached: 0.0012 sigmas, sigmas to 0.1 %, correlations to 0.0003.
    assert (np.abs(turn @ values - STATE) < 0.003 * np.array(SIGMA)).all()
    ours = turn @ found.matrix @ turn.T
    scale = np.sqrt(np.diag(ours))
    assert (np.abs(scale / SIGMA - 1.0) < 0.002).all()
    assert np.abs(ours / np.outer(scale, scale) - matrix / np.outer(SIGMA, SIGMA)).max() < 1e-3
    off = (turn @ values - STATE) / SIGMA
    # All six together: 0.009.
    assert np.sqrt(off @ np.linalg.solve(matrix / np.outer(SIGMA, SIGMA), off)) < 0.03
