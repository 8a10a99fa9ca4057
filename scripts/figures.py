"""Draw the pictures of the docs anew: run scenarios and copy, reduced, those of their pictures that the docs show.

    python scripts/figures.py                           # all of them: about twenty minutes, on an idle machine
    python scripts/figures.py --pages                   # of the blocks of README and docs/guide/pictures.md
    python scripts/figures.py kepler arenstorf          # of these scenarios
    python scripts/figures.py --from results kepler   # of what `orbits run kepler` has drawn already

A picture belongs to the docs if a file of its name is in docs/figures. It is reduced to 1,500 pixels width and 256
colours, to keep the repository small. `work_precision` measures times, so its picture needs an idle machine.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from contextlib import chdir
from io import BytesIO
from pathlib import Path

from PIL import Image

from orbits.scenario import bundled

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / "docs" / "figures"
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
WIDTH, WIDEST, COLOURS = 1500, 1920, 256


def reduced(source: Path, target: Path) -> None:
    """Write a picture in the size of the docs, or in its own where that takes fewer bytes: dense dots do."""
    with Image.open(source) as picture:
        whole = picture.convert("RGB")
    height = round(whole.height * WIDTH / whole.width)
    sizes = [whole.resize((WIDTH, height), Image.Resampling.LANCZOS)]
    sizes += [whole] * (whole.width <= WIDEST)
    target.write_bytes(min(map(coded, sizes), key=len))


def coded(picture: Image.Image) -> bytes:
    """Return a picture as a PNG of few colours."""
    memory = BytesIO()
    # Every colour in reach, not the most frequent ones: thin lines must not take on the colour of others.
    small = picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE)
    small.save(memory, "png", optimize=True)
    return memory.getvalue()


def pages(folder: Path) -> None:
    """Run the blocks of pages that save the pictures which these pages show."""
    for page in ("README.md", "docs/guide/pictures.md"):
        block = BLOCK.search((ROOT / page).read_text(encoding="utf-8"))
        assert block is not None
        with chdir(folder):
            exec(compile(block[1], page, "exec"), {})


def main() -> None:
    """Run what is asked for and replace the pictures."""
    names = [scenario.name for scenario in bundled()]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenarios", nargs="*", help="names; all by default")
    parser.add_argument("--pages", action="store_true", help="draw those of the blocks of pages, and nothing else")
    parser.add_argument("--from", dest="results", type=Path, help="a results folder; nothing is run then")
    given = parser.parse_args()
    if unknown := sorted(set(given.scenarios) - set(names)):
        parser.error(f"there is no scenario {unknown[0]!r}; expected some of {', '.join(names)}")
    for name in ["pages"] if given.pages else given.scenarios or names:
        with tempfile.TemporaryDirectory() as scratch:
            folder = given.results / name if given.results else Path(scratch)
            if given.pages:
                pages(folder)
            elif not given.results:
                subprocess.run([sys.executable, "-m", "orbits", "run", name, "--out", str(folder)], check=True)
            for picture in sorted(folder.glob("*.png")):
                if (FIGURES / picture.name).is_file():
                    reduced(picture, FIGURES / picture.name)
                    print(f"{FIGURES / picture.name}: {(FIGURES / picture.name).stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    main()
