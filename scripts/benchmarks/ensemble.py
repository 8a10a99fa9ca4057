"""Ensembles: what a block costs beside its work, and campaigns on one and two workers."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from astropy import units as u

import orbits
from orbits import ensemble

MEMBERS, YEARS = 8192, 100
BLOCKS = 256, 1024, 4096
OPTIONS: dict[str, Any] = {
    "duration": YEARS * u.yr,
    "dt": "30 d",
    "integrator": orbits.WisdomHolman(encounters="retire"),
    "progress": False,
}


def _belt() -> ensemble.Ensemble:
    rng = np.random.default_rng(1)
    giants = ["Sun", "Jupiter", "Saturn", "Uranus", "Neptune"]
    planets = orbits.System.solar_system(epoch="2022-08-09", bodies=giants)
    a, e, inc = rng.uniform(2.1, 3.4, MEMBERS), rng.uniform(0, 0.3, MEMBERS), rng.uniform(0, 0.3, MEMBERS)
    Omega, omega, M = rng.uniform(0, 6.28, (3, MEMBERS))
    names = [f"p{k}" for k in range(MEMBERS)]
    whole = planets.add(names, primary="Sun", a=a * u.au, e=e, inc=inc, Omega=Omega, omega=omega, M=M)
    return ensemble.particles(planets, whole)


def part_ensemble(repetitions: int) -> dict[str, Any]:
    """A campaign of 8,192 particles of the belt among Sun and giants: a century by `WisdomHolman` in steps of 30 days,
    start and end in archives, in blocks of several sizes. The seconds are the least of campaigns that take turns.
    "Processor here" is the processor time of the campaign's own process, which includes Dask's scheduler if there is
    one; "of workers" is that of the workers' processes. Each block also writes its archive and its table and checks its
    steps, and marches the planets again: "ms a block beside" is what that costs, the processor time on one thread above
    that with blocks of 4,096 members, per block. Other work on the machine changes the seconds, and hardly the
    processor times.
    """
    belt = _belt()
    least: dict[tuple[str, int, int], float] = {}
    spent: dict[tuple[str, int, int], float] = {}
    there: dict[tuple[str, int, int], float] = {}
    with _cluster(1) as one, _cluster(2) as two, tempfile.TemporaryDirectory() as folder:
        cases: list[tuple[str, int, int, dict[str, Any]]] = [("threads", 1, block, {"workers": 1}) for block in BLOCKS]
        cases += [("threads", 2, block, {"workers": 2}) for block in BLOCKS]
        for count, cluster in ((1, one), (2, two)):
            if cluster is not None:
                cases += [("Dask workers", count, block, {"client": cluster}) for block in BLOCKS]
        for k in range(max(2, repetitions)):
            for what, count, block, how in cases:
                place = Path(folder) / f"{k}-{what}-{count}-{block}"
                key, client = (what, count, block), how.get("client")
                begun = time.perf_counter(), time.process_time(), _processors(client)
                ensemble.run(belt, place, block=block, **OPTIONS, **how)
                least[key] = min(least.get(key, np.inf), time.perf_counter() - begun[0])
                spent[key] = min(spent.get(key, np.inf), time.process_time() - begun[1])
                there[key] = min(there.get(key, np.inf), _processors(client) - begun[2])
    base = spent["threads", 1, max(BLOCKS)]
    rows = []
    for (what, count, block), seconds in least.items():
        blocks = -(-MEMBERS // block)
        rows.append(
            {
                "workers": f"{count} {what}"[: None if count > 1 else -1],
                "members of a block": block,
                "seconds": seconds,
                "processor here": spent[what, count, block],
                "of workers": there[what, count, block] or None,
                "ms a block beside": None if (what, count) != ("threads", 1) or block == max(BLOCKS)
                else 1e3 * (spent[what, count, block] - base) / blocks,
                "times faster than one": least[what, 1, block] / seconds if count > 1 else None,
            }
        )
    return {"rows": rows}


@contextmanager
def _cluster(workers: int) -> Iterator[Any]:
    """Yield a client of a Dask cluster of separate processes; None without Dask."""
    try:
        import distributed
    except ImportError:
        yield None
        return
    quiet = {"dashboard_address": ":0", "silence_logs": "CRITICAL"}
    with (
        distributed.LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, **quiet) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


def _processors(client: Any) -> float:
    """Return the seconds of the processor that workers have taken; 0 without them."""
    return 0.0 if client is None else sum(client.run(time.process_time).values())
