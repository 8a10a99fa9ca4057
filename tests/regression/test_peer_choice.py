"""Peers by name, with options: what a user types reaches REBOUND, and what does not fit is answered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rebound

import orbits
from orbits.errors import InputError, UnknownNameError
from orbits.regression import peers
from orbits.regression.peer_choice import OPTIONS, PEERS, POSITIVE, listed, lookup

from ..coverings import each
from ..mixed_bodies import DT, GM, Q, V

MASSIVE = GM > 0
START = orbits.System(["Jupiter", "Sun", "Saturn"], GM[MASSIVE], Q[MASSIVE], V[MASSIVE])


def typed(known):
    """Return values of an option as they are typed."""
    return ["0.5"] if known is POSITIVE else [str(each) for each in known]


EVERY = [
    f"{name}:{option}={value}" for name, known in OPTIONS.items() for option in known for value in typed(known[option])
]


@each("text", EVERY)
def test_every_option_is_one_of_rebound_and_arrives_there(text):
    peer = lookup(text)
    assert (peer.name, peer.integrator) == (text, text.partition(":")[0])
    sim = rebound.Simulation()
    sim.integrator = peer.integrator
    fresh = {option: getattr(sim.integrator, option) for option, _ in peer.options}
    for option, value in peer.options:
        setattr(sim.integrator, option, value)
    option, value = text.partition(":")[2].split("=")
    arrived = str(getattr(sim.integrator, option)).lower()
    assert arrived in ({"1": ("1", "default")}.get(value, value) if option == "type" else value)
    assert option in fresh


@each("text", [each for each in EVERY if not each.startswith(("whfast512", "ias15"))])
def test_every_option_is_run_by_rebound(text):
    run = peers.run(text, START.values, times=np.array([20 * DT]), dt=DT)
    truth = peers.run("ias15", START.values, times=np.array([20 * DT]), dt=DT)
    assert run.steps == 20
    assert np.abs(run.q - truth.q).max() < 3e-4  # by the leapfrog 1.4e-4 au, by others 1.4e-5


def test_every_combination_of_whfast_that_is_accepted_runs_and_every_refused_one_is_refused_by_rebound_or_wrong():
    """The second corrector in other coordinates than Jacobi's is the one that REBOUND computes without a word."""
    known, accepted = OPTIONS["whfast"], 0
    truth = peers.run("ias15", START.values, times=np.array([4 * DT]), dt=DT).q
    for kernel in known["kernel"]:
        for coordinates in known["coordinates"]:
            for corrector in (0, 3, 17):
                for corrector2 in (0, 1):
                    chosen = {"kernel": kernel, "coordinates": coordinates}
                    chosen |= {"corrector": corrector, "corrector2": corrector2}
                    text = "whfast:" + ",".join(f"{key}={value}" for key, value in chosen.items())
                    try:
                        peer = lookup(text)
                    except InputError:
                        assert coordinates != "jacobi"
                        assert kernel != "default" or corrector2 or coordinates == "whds"
                        continue
                    accepted += 1
                    run = peers.run(peer.name, START.values, times=np.array([4 * DT]), dt=DT)
                    assert np.abs(run.q - truth).max() < 1e-5, text  # 2.8e-6 is the most
    assert accepted == 24 + 3 + 3 + 1  # all of Jacobi's; barycentric and democratic ones; whds


def test_names_are_separated_by_commas_and_options_belong_to_the_name_before_them():
    for text, names in {
        "whfast,ias15": ["whfast", "ias15"],
        "whfast:kernel=lazy,corrector=17,ias15": ["whfast:kernel=lazy,corrector=17", "ias15"],
        "WHFast : kernel = lazy , corrector = 17 , leapfrog": ["whfast:kernel=lazy,corrector=17", "leapfrog"],
        "saba:type=10,6,4,ias15:epsilon=1e-7": ["saba:type=10_6_4", "ias15:epsilon=1e-07"],
        "saba:type=H-10-6-4,trace:peri_mode=full-bs": ["saba:type=h_10_6_4", "trace:peri_mode=full_bs"],
        "whfast:kernel=modified-kick,corrector2=on": ["whfast:kernel=modifiedkick,corrector2=1"],
        "whfast,": ["whfast"],
        "": [],
    }.items():
        assert [peer.name for peer in listed(text)] == names
    assert [peer.name for peer in listed(["whfast:corrector=3", "whfast:corrector=5"])] == [
        "whfast:corrector=3",
        "whfast:corrector=5",
    ]


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("whfats", r"no peer is called 'whfats'; there are whfast, .*leapfrog\. Did you mean 'whfast'\?"),
        ("whfats:kernel=lazy", r"no peer is called 'whfats'; there are whfast, .*Did you mean 'whfast'\?"),
        ("janus", r"no peer is called 'janus'; there are whfast"),
        ("whfast:kernal=lazy", r"has no option 'kernal'; it takes kernel, corrector, corrector2, coordinates\. Did"),
        ("whfast512:kernel=lazy", r"whfast512 has no option 'kernel'; it takes corrector\."),
    ],
)
def test_an_unknown_name_is_answered_with_those_that_there_are(text, answer):
    with pytest.raises(UnknownNameError, match=answer):
        listed(text)


@each(
    ("text", "answer"),
    [
        ("whfast:kernel=slow", r"kernel is 'slow'; expected default, modifiedkick, composition, lazy"),
        ("whfast:corrector=13", r"corrector is '13'; expected 0, 3, 5, 7, 11, 17"),
        ("whfast:corrector=", r"corrector is ''; expected 0, 3, 5, 7, 11, 17"),
        ("saba:type=5", r"type is '5'; expected 1, 2, 3, 4, cm_1, .*h_10_6_4"),
        ("trace:r_crit_hill=-1", r"r_crit_hill is '-1'; expected a number above 0"),
        ("ias15:epsilon=nan", r"epsilon is 'nan'; expected a number above 0"),
        ("whfast:lazy", r"'lazy' is not an option; expected OPTION=VALUE after the colon, such as whfast:kernel=lazy"),
        ("whfast:", r"an option is missing; expected OPTION=VALUE after the colon, such as whfast:kernel=lazy"),
        ("whfast:corrector=3,corrector=5", r"corrector is given twice, as 3 and 5"),
        ("whfast:kernel=lazy,coordinates=whds", r"kernel=lazy in Jacobi coordinates only; leave out coordinates=whds"),
        ("whfast:coordinates=barycentric,corrector2=1", r"second corrector is one for Jacobi coordinates; leave out"),
        ("whfast-heliocentric:corrector2=1", r"leave out coordinates=democraticheliocentric, or corrector2"),
        ("whfast:coordinates=whds,corrector=17", r"no corrector in the coordinates whds; leave out corrector=17"),
        ("whfast,whfast", r"'whfast' is compared twice; give each peer once"),
        ("whfast-corrector17,whfast:corrector=17", r"'whfast:corrector=17' is 'whfast-corrector17' again"),
        (["whfast", 3], r"against holds 3; expected names of peers"),
        (17, r"against must be names of peers, such as \['whfast'\], or \[\] for none; got 17"),
    ],
)
def test_an_option_or_combination_that_does_not_fit_is_refused_with_what_does(text, answer):
    with pytest.raises(InputError, match=answer):
        listed(text)


def test_a_comparison_takes_peers_with_options_and_shows_them():
    against = "whfast:kernel=lazy,corrector=17,trace"
    report = orbits.compare(
        START, orbits.WisdomHolman(), dt=DT, duration=20 * DT, samples=3, against=against, reference="none"
    )
    assert [row.method for row in report.rows[1:]] == ["REBOUND whfast:kernel=lazy,corrector=17", "REBOUND trace"]
    assert all(row.energy is not None for row in report.rows)
    with pytest.raises(UnknownNameError, match="Did you mean 'corrector'"):
        orbits.compare(START, dt=DT, duration=DT, against=["whfast:corector=17"])


def test_the_page_on_comparing_lists_every_peer_option_and_value():
    page = (Path(__file__).parents[2] / "docs" / "comparing.md").read_text(encoding="utf-8")
    for name, known in OPTIONS.items():
        (row,) = [line for line in page.splitlines() if line.startswith(f"| `{name}` ")]
        for option, values in known.items():
            assert f"`{option}`" in row
            assert all(f"`{value}`" in row for value in typed(values) if values is not POSITIVE)
    assert all(f"`{name}`" in page for name in PEERS)
