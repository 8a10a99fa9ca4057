"""Draw the pictures of docs/theory.md: phase portraits, discrete Legendre transforms, a translated trajectory.

    python scripts/theory_figures.py        # all of them, some seconds

Curves and arrows are computed by the methods that the page describes; the throw, which they solve exactly,
by a formula.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import orbits
from orbits import discrete
from orbits.plotting import save, style

sys.path.insert(0, str(Path(__file__).parent))

from figures import FIGURES, reduced

pendulum = orbits.lagrangians.pendulum


def arrow(axes: Any, start: tuple[float, float], change: tuple[float, float], colour: str, width: float = 2.2) -> None:
    """Draw an arrow from a point, of the given change of both coordinates."""
    end = (start[0] + change[0], start[1] + change[1])
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": width, "mutation_scale": 18})


def phase_portraits() -> Any:
    """The pendulum by a method that gains area, one that loses it, and a variational one."""
    made = style.figure(16.0, 6.4)
    panels = made.subplots(1, 3, sharex=True, sharey=True)
    cases = (
        (orbits.ExplicitEuler(), 0.1, 120, "explicit Euler, h = 0.1: areas grow"),
        (orbits.RungeKutta4(), 1.0, 200, "Runge–Kutta 4, h = 1: areas shrink"),
        (orbits.StormerVerlet(), 1.0, 500, "Störmer–Verlet, h = 1: areas stay"),
    )
    angle, momentum = np.meshgrid(np.linspace(-4.0, 4.0, 400), np.linspace(-2.9, 2.9, 300))
    for axes, (method, h, steps, title) in zip(panels, cases, strict=True):
        energy = momentum**2 / 2 - np.cos(angle)
        levels = [-np.cos(0.5), -np.cos(1.1), -np.cos(1.75), 1.0, 2.2]
        axes.contour(angle, momentum, energy, levels, colors=style.FAINT, linewidths=1.2, linestyles="solid")
        for start, colour in zip((0.5, 1.1, 1.75), style.PALETTE, strict=False):
            path = orbits.march(pendulum, method, q=[start], v=[0.0], dt=h, steps=steps)
            axes.plot(path.q[:, 0], path.p[:, 0], ".", color=colour, markersize=4.5)
            axes.plot(path.q[0, 0], path.p[0, 0], "o", color=colour, markersize=9, markeredgecolor="white")
        axes.set(title=title, xlabel="angle q [rad]", xlim=(-4, 4), ylim=(-2.9, 2.9))
    panels[0].set_ylabel("momentum p")
    style.below(made, [], [], "discs: the starts; grey: exact orbits of the pendulum, L = v²/2 + cos q")
    return made


def legendre_transforms() -> Any:
    """Left the two transforms of a step, right the momenta on both sides of each point of two paths."""
    made = style.figure(16.0, 6.8)
    scheme, points = made.subplots(1, 2, width_ratios=[1.0, 1.25])
    scheme.set(xlim=(0, 10), ylim=(0, 10), xticks=[], yticks=[], title="one step")
    scheme.spines[:].set_visible(False)
    boxes = {(5, 8.6): "(q₀, q₁)", (1.6, 2.6): "(q₀, p₀)", (8.4, 2.6): "(q₁, p₁)"}
    for (x, y), text in boxes.items():
        box = {"boxstyle": "round,pad=0.5", "facecolor": "white", "edgecolor": style.INK}
        scheme.text(x, y, text, ha="center", va="center", fontsize=19, bbox=box)
    arrow(scheme, (4.1, 7.7), (-1.9, -4.1), style.BLUE)
    arrow(scheme, (5.9, 7.7), (1.9, -4.1), style.VERMILION)
    arrow(scheme, (3.3, 2.6), (3.4, 0.0), style.INK)
    scheme.text(2.7, 6.0, "F⁻", color=style.BLUE, fontsize=21, ha="right")
    scheme.text(7.3, 6.0, "F⁺", color=style.VERMILION, fontsize=21)
    scheme.text(5.0, 3.0, "F̃ = F⁺ ∘ (F⁻)⁻¹", fontsize=17, ha="center")
    scheme.text(1.6, 1.1, "p₀ = −D₁Ld(q₀, q₁)", color=style.BLUE, fontsize=16, ha="center")
    scheme.text(8.4, 1.1, "p₁ = D₂Ld(q₀, q₁)", color=style.VERMILION, fontsize=16, ha="center")

    h, steps = 0.8, 6
    L_d = discrete.midpoint(pendulum)
    solved = orbits.march(pendulum, orbits.Gauss(stages=1), q=[-1.4], v=[0.9], dt=h, steps=steps).q
    bent = solved + 0.45 * np.sin(np.linspace(0.0, np.pi, steps + 1))[:, None] * (-1.0) ** np.arange(steps + 1)[:, None]
    t = h * np.arange(steps + 1)
    for q, shift in ((solved, 0.0), (bent, 3.2)):
        points.plot(t, q[:, 0] + shift, "o-", color=style.GREY, linewidth=1.0, markersize=7)
        for k in range(steps + 1):
            if k > 0:
                arriving = discrete.legendre_plus(L_d, q[k - 1], q[k], h)[1][0]
                arrow(points, (t[k], q[k, 0] + shift), (0.36, 0.36 * arriving), style.VERMILION, 3.4)
            if k < steps:
                leaving = discrete.legendre_minus(L_d, q[k], q[k + 1], h)[1][0]
                arrow(points, (t[k], q[k, 0] + shift), (0.36, 0.36 * leaving), style.BLUE, 1.6)
    points.text(0.0, 4.0, "any path:\nthe momenta differ", fontsize=15)
    points.text(1.3, -1.2, "a path that solves the discrete\nEuler–Lagrange equations: they match", va="top")
    points.set(title="momenta on both sides of each point", xlabel="time t", ylabel="angle q [rad]", ylim=(-2.6, 5.6))
    points.set_yticks([])
    caption = (
        "slopes of arrows are momenta: red the one that arrives at a point, from the step before it, D₂Ld; blue the "
        "one that leaves it, −D₁Ld; pendulum, midpoint rule, h = 0.8; the upper path is drawn shifted"
    )
    style.below(made, [], [], caption)
    return made


def translated_trajectory() -> Any:
    """A discrete trajectory and its image under a symmetry: a translation of a throw, a rotation of a Kepler arc."""
    made = style.figure(16.0, 6.4)
    throw, arc = made.subplots(1, 2)
    h = 0.25
    k = np.arange(9)
    fall = np.column_stack([0.9 * h * k, 1.9 * h * k - (h * k) ** 2 / 2])  # what midpoint steps give without rounding
    kepler = orbits.march(orbits.lagrangians.kepler, orbits.StormerVerlet(), dt=0.12, steps=9)
    s = np.radians(70.0)
    turn = np.array([[np.cos(s), -np.sin(s)], [np.sin(s), np.cos(s)]])
    cases: tuple[tuple[Any, np.ndarray, Callable[[np.ndarray], np.ndarray], Any, Any], ...] = (
        (throw, fall, lambda q: q + np.array([0.8, 0.0]), lambda q: np.array([1.0, 0.0]), lambda j: [0.9, 1.9 - h * j]),
        (arc, kepler.q, lambda q: q @ turn.T, lambda q: np.array([-q[1], q[0]]), lambda j: kepler.p[j]),
    )
    for axes, path, moved, generator, momentum in cases:
        image = moved(path)
        axes.plot(*path.T, "o-", color=style.BLUE, markersize=7, linewidth=1.6)
        axes.plot(*image.T, "o-", color=style.SKY, markersize=7, linewidth=1.6)
        for point in path[1:-1]:
            arrow(axes, tuple(point), tuple(0.2 * generator(point)), style.GREY, 1.4)
        for j, name, offset in ((0, "0", (-10, -24)), (len(path) - 1, "N", (-30, 8))):
            arrow(axes, tuple(path[j]), tuple(0.35 * generator(path[j])), style.GREY, 2.6)
            arrow(axes, tuple(path[j]), tuple(0.35 * np.asarray(momentum(j))), style.VERMILION, 2.6)
            style.halo(axes.annotate(f"q{name}", path[j], offset, textcoords="offset points", fontsize=16))
        axes.set(xlabel="x", ylabel="y")
        axes.set_aspect("equal")
        axes.set_ylim(path[:, 1].min() - 0.35, image[:, 1].max() + 0.3)
    throw.set_title("a throw, translated along x: conserved is pₓ")
    arc.plot(0.0, 0.0, "o", color=style.ORANGE, markersize=13)
    arc.set_title("a Kepler arc, rotated: conserved is the angular momentum")
    caption = (
        "blue: a discrete trajectory; light blue: its image under a symmetry, which has the same action; grey: the "
        "generator ξ; red: the momenta at both ends; p·ξ is the same at q0 and qN, as only the ends change the action"
    )
    style.below(made, [], [], caption)
    return made


def main() -> None:
    """Draw and reduce all pictures."""
    for draw in (phase_portraits, legendre_transforms, translated_trajectory):
        with tempfile.TemporaryDirectory() as scratch, style.look():
            whole = Path(scratch) / f"{draw.__name__}.png"
            save(draw(), whole)
            reduced(whole, FIGURES / whole.name)
            print(f"{FIGURES / whole.name}: {(FIGURES / whole.name).stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    main()
