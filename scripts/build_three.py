"""Rebuild, or check, the vendored three.js of the view in the browser.

    python scripts/build_three.py verify   # hashes of the vendored files against those below; needs nothing
    python scripts/build_three.py          # bundle it anew, byte for byte; needs npm and its registry, on Linux x86-64

The bundle has the parts of three.js that the view uses, minified by esbuild into one classic script that defines
`THREE`: modules of their own cannot be loaded by a page that is opened from disk. Both packages are fetched with
`npm pack`, and refused unless they have the hashes below. Each command ends with exit code 0 if all is as it should
be, 1 otherwise.
"""

from __future__ import annotations

import base64
import hashlib
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

STATIC = Path(__file__).resolve().parents[1] / "orbits" / "viewing" / "static"

PACKAGES = {
    "three@0.187.0": "Qiu7R+Cmh8CstZsY1uJOSWnVlfo7ZtNLV7mF8Jltk3LB3AtDu9cRZlcnRKkAk8Y4z6KKw35z7Y7Urd7jWY8etA==",
    "@esbuild/linux-x64@0.28.2": (
        "4xTZr1FUmSoQW4XIWmit3tzQrUTZM+N3P0XV8xROKYF50XfI7xeO90+1bZvNwxIufQ9hDQVRJH5YhgPVF8A/HQ=="
    ),
}
"""Packages of the npm registry, each with the SHA-512 of its archive, in base64, as the registry gives it."""

VENDORED = {
    "three.min.js": "89dc2c6cef5933c61d592a3a21bd29d2825845a57e2ab397cf2a20461a611783",
    "three.LICENSE": "8b378ebe60e2fe500158cb0ac71cb5e8b7d92953c2abcc63a0eb90499653b5bc",
}
"""The vendored files, each with its SHA-256."""

ENTRY = """\
export {
  BufferAttribute, BufferGeometry, DynamicDrawUsage, GLSL3, InstancedBufferAttribute, InstancedBufferGeometry,
  InstancedInterleavedBuffer, InterleavedBufferAttribute, Mesh, PerspectiveCamera, Points, RawShaderMaterial, Scene,
  Vector2, Vector3, WebGLRenderer
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
"""


def verify() -> bool:
    """Compare the vendored files with their hashes."""
    good = True
    for name, expected in VENDORED.items():
        path = STATIC / name
        found = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "missing"
        print(f"{path}: {found}" + ("" if found == expected else f", but expected {expected}"))
        good &= found == expected
    return good


def fetched(name: str, digest: str, folder: Path) -> Path:
    """Unpack a package of the registry below `folder`, and return where. Ends the program if its hash is another."""
    command = ["npm", "pack", name, "--silent", "--pack-destination", str(folder)]
    printed = subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder).stdout
    archive = folder / printed.split()[-1]
    found = base64.b64encode(hashlib.sha512(archive.read_bytes()).digest()).decode()
    if found != digest:
        raise SystemExit(f"{name} has the SHA-512 {found}; expected {digest}")
    with tarfile.open(archive) as packed:
        packed.extractall(folder / archive.stem, filter="data")
    return folder / archive.stem / "package"


def build() -> bool:
    """Fetch both packages, bundle what the view uses, and say whether the hashes are the known ones."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        three, esbuild = (fetched(name, digest, folder) for name, digest in PACKAGES.items())
        modules = folder / "node_modules"
        modules.mkdir()
        three.rename(modules / "three")
        (folder / "entry.js").write_text(ENTRY, encoding="utf-8")
        options = ["--bundle", "--minify", "--format=iife", "--global-name=THREE", "--legal-comments=inline"]
        options += ["--target=es2020", "--log-level=warning", f"--outfile={STATIC / 'three.min.js'}"]
        program = esbuild / "bin" / "esbuild"
        program.chmod(0o755)
        subprocess.run([program, "entry.js", *options], check=True, cwd=folder)
        (STATIC / "three.LICENSE").write_bytes((modules / "three" / "LICENSE").read_bytes())
    return verify()


if __name__ == "__main__":
    if sys.argv[1:] not in ([], ["verify"]):
        raise SystemExit(__doc__)
    raise SystemExit(0 if (verify() if sys.argv[1:] else build()) else 1)
