#!/usr/bin/env python3
"""Renders scenes with other renderers, measures them by `freelux compare`, and writes rows for `freelux chart --add`."""

import argparse
import csv
import math
import platform
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from scene import Untranslatable, load

COLUMNS = ["scene", "method", "quality", "repeat", "seconds", "relmse", "robust", "reference_relmse", "reference_robust"]
COLUMNS += ["flip", "ratio_of_means", "width", "height", "threads", "cpu", "version", "reference"]
PEERS = ["mitsuba-path", "mitsuba-path-oidn", "radiance"]


def main() -> None:
    arguments = parse()
    rows = []
    for path in arguments.scenes:
        try:
            scene = load(path)
        except Untranslatable as reason:
            sys.exit(f"{reason}")
        own = own_error(scene.reference)
        for name in arguments.peers:
            try:
                peer = make(name, scene, arguments)
            except Untranslatable as reason:
                print(f"{name} is left out: {reason}")
                continue
            rows += sweep(peer, scene, own, arguments)
            with open(arguments.out, "w", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS)
                writer.writeheader()
                writer.writerows(rows)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE.toml", help="scenes with reference.exr beside them")
    parser.add_argument("--out", type=Path, default=Path("peers.csv"), help="the rows (peers.csv)")
    parser.add_argument("--peers", type=lambda text: text.split(","), default=PEERS, help=f"of {','.join(PEERS)} (all)")
    parser.add_argument("--freelux", default="freelux", help="the program that measures (freelux)")
    parser.add_argument("--threads", type=int, default=2, help="of each renderer (2)")
    parser.add_argument("--max-seconds", type=float, default=10, help="no picture that must be expected to take longer (10)")
    parser.add_argument("--repeat", type=int, default=1, help="pictures of each quality (1)")
    parser.add_argument("--sampler", default="multijitter", help="Mitsuba's sampler (multijitter)")
    arguments = parser.parse_args()
    if unknown := set(arguments.peers) - set(PEERS):
        parser.error(f"no peer is called {', '.join(unknown)}")
    return arguments


def make(name: str, scene, arguments):
    """Loads a scene into a renderer; imports only what is asked for."""
    if name == "radiance":
        from radiance_peer import Radiance

        return Radiance(scene, arguments.threads)
    from mitsuba_peer import Mitsuba

    return Mitsuba(scene, arguments.threads, arguments.sampler, denoise=name.endswith("oidn"))


def sweep(peer, scene, own, arguments) -> list[dict]:
    """Renders at rising quality until a picture would take too long."""
    rows, last = [], 0.0
    for quality in peer.qualities:
        if last * peer.growth > arguments.max_seconds:
            break
        for repeat in range(arguments.repeat):
            picture, last = peer.render(quality, seed=repeat)
            row = measure(picture, scene.reference, arguments.freelux)
            row |= {"scene": scene.name, "method": peer.name, "quality": quality, "repeat": repeat, "seconds": last}
            row |= dict(zip(["reference_relmse", "reference_robust"], own))
            row |= {"width": scene.size[0], "height": scene.size[1], "threads": arguments.threads}
            row |= {"cpu": cpu(), "version": peer.version, "reference": scene.reference}
            rows.append(row)
            found = f"relMSE {row['relmse']:.2e}, robust {row['robust']:.2e}, means {row['ratio_of_means']:.4f}"
            print(f"{scene.name} {peer.name} {quality}: {last:.2f} s, {found}", flush=True)
    return rows


def measure(picture: np.ndarray, reference: Path, freelux: str) -> dict:
    """Measures by `freelux compare`, so that every line of a chart has the same definition of error."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "picture.exr"
        write_exr(file, picture)
        text = subprocess.run([freelux, "compare", file, reference], check=True, capture_output=True, text=True).stdout
    names = {"relMSE": "relmse", "relMSE robust": "robust", "FLIP": "flip", "ratio of means": "ratio_of_means"}
    found = {key: re.search(rf"^{name} +([\d.e+-]+)", text, re.MULTILINE) for name, key in names.items()}
    return {key: float(match[1]) for key, match in found.items()}


def own_error(reference: Path) -> tuple[float, float]:
    """Returns what a perfect picture would have against the reference, plain and robust, as docs/chart.md defines it."""
    pixels, variance = read_exr(reference), read_exr(reference.with_name("variance.exr"))
    exposure = 0.8 / np.percentile(pixels.mean(2), 90)
    expected = (exposure**2 * variance / ((exposure * pixels) ** 2 + 0.01)).mean(2).ravel()
    kept = np.sort(expected)[: expected.size - math.floor(expected.size / 1000)]
    return expected.mean(), kept.mean()


def bitmaps():
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant("llvm_ad_rgb")
    return mi


def read_exr(path: Path) -> np.ndarray:
    return np.array(bitmaps().Bitmap(str(path)), np.float64)[..., :3]


def write_exr(path: Path, picture: np.ndarray) -> None:
    bitmaps().Bitmap(np.ascontiguousarray(picture, np.float32)).write(str(path))


def cpu() -> str:
    """Returns the processor's name as `freelux chart` gives it."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


if __name__ == "__main__":
    main()
