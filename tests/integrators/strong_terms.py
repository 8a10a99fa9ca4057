"""Terms of a star, 1e4 times as strong as those of the Sun, and marches with them."""

import orbits
from orbits.lagrangians.newtonian import n_body
from orbits.lagrangians.terms.frame_dragging import frame_dragging
from orbits.lagrangians.terms.post_newtonian import post_newtonian
from orbits.lagrangians.terms.zonal_harmonics import zonal_harmonics
from orbits.marching.legs.leg import Leg

DEFAULT, GAUSS = orbits.WisdomHolman(), orbits.Gauss(stages=8)
POLE = (0.36, 0.48, 0.8)

STRONG = {
    "relativity": lambda row: [post_newtonian(row, 100.0)],
    "oblateness": lambda row: [zonal_harmonics(row, 0.05, POLE, {2: 2e-3, 3: 1e-4})],
    "all": lambda row: [
        zonal_harmonics(row, 0.05, POLE, {2: 2e-3}),
        post_newtonian(row, 100.0),
        frame_dragging(row, (1e-6, 2e-6, 5e-6)),
    ],
}


def marcher(method, terms, start, h, **options):
    gm, q, v = start
    L = n_body(gm[gm > 0], 0.0, terms)
    return Leg.of(L, method, L.parameter_vector, gm > 0, q, v, h, **options)


def marched(method, terms, start, h, steps, **options):
    run = marcher(method, terms, start, h, **options)
    run.advance(steps)
    return run.state()
