"""Variations of a run: state-transition matrices, and MEGNO with Lyapunov exponents.

`following` lets tangent vectors follow the march of a run, whose bits they do not change: they use the steps that it
has taken. A massless particle is followed as a body whose mass moves nothing, in a march of its own among the massive
ones.
"""
