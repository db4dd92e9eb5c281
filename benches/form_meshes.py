#!/usr/bin/env python3
"""The gallery's free forms beside meshes of them: bytes, and processor seconds to load and render, as a table in Markdown.

    cargo build --release -p freelux
    python3 benches/form_meshes.py [--freelux PROGRAM] [--out FOLDER] [SCENE ...]

Each form of a scene becomes one OBJ file by `freelux mesh`, and a copy of the scene names these files in the place of the forms. Both are
rendered by the same command. Of a form with copies one is meshed, and all are counted; such a scene is not rendered. A form without bounds stays.
"""

import argparse
import math
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCENES = ROOT / "cli" / "scenes"
# Cells so small that no facet shows at this size, metres, and what the render command has beside the size.
CASES = {
    "form-figure": (0.02, []),
    "form-glass": (0.0015, []),
    "form-part": (0.015, ["--quality", "0.1"]),
    "form-field": (0.05, ["--quality", "0.3"]),
}
SIZE = "360x240"


def tables(text):
    """Splits a scene into its tables; what stands before the first is one too."""
    return re.split(r"^(?=\[)", text, flags=re.MULTILINE)


def run(command):
    """Runs a command and returns its processor seconds, or ends with what it said."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime - before.ru_utime) + (after.ru_stime - before.ru_stime)


def is_unbounded(form):
    """Whether a form is a single quadric that has no end."""
    return "clip" not in form and not {"sphere", "ellipsoid"} >= set(form.get("quadric", {}))


def mesh_scene(freelux, scene, cell, folder):
    """Writes the scene with meshes in the place of its forms; returns its path, triangles, bytes of OBJ, and the copies of the largest repeat."""
    parts, triangles, size, most = [], 0, 0, 1
    for number, table in enumerate(tables(scene.read_text())):
        if not table.startswith("[[form]]"):
            parts.append(table)
            continue
        form = tomllib.loads(table)["form"][0]
        copies = math.prod(form["repeat"]["count"]) if "repeat" in form else 1
        alone = re.sub(r"^repeat\s*=.*$", "", table, flags=re.MULTILINE)
        alone = re.sub(r"^(material|projection)\b.*$", "", alone, flags=re.MULTILINE)
        source, obj = folder / f"{scene.stem}-{number}.toml", folder / f"{scene.stem}-{number}.obj"
        if is_unbounded(form):
            parts.append(table)
            continue
        source.write_text(alone)
        run([freelux, "mesh", source, "--cell", str(cell), "--out", obj])
        with obj.open("rb") as lines:
            triangles += copies * sum(line.startswith(b"f ") for line in lines)
        size += copies * obj.stat().st_size
        most = max(most, copies)
        material = f'material = "{form["material"]}"\n' if "material" in form else ""
        parts.append(f'[[mesh]]\nfile = "{obj.name}"\n{material}\n')
    meshed = folder / f"{scene.stem}-mesh.toml"
    meshed.write_text("".join(parts))
    return meshed, triangles, size, most


def row(freelux, name, folder):
    """Returns a line of the table."""
    cell, options = CASES[name]
    scene = SCENES / f"{name}.toml"
    meshed, triangles, size, copies = mesh_scene(freelux, scene, cell, folder)

    def render(path, suffix):
        out = folder / f"{name}-{suffix}.png"
        return run([freelux, "render", path, "--size", SIZE, *options, "--out", out])

    own = scene.stat().st_size
    form_seconds = render(scene, "form")
    mesh_seconds = f"{render(meshed, 'mesh'):.1f}" if copies == 1 else "not rendered"
    command = f" (`{' '.join(options)}`)" if options else ""
    return (f"| {name} | {own} | {cell} | {triangles} | {size} ({size / own:.0f} times) | {form_seconds:.1f}{command} | "
            f"{mesh_seconds} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--freelux", default=ROOT / "target" / "release" / "freelux", help="the program")
    parser.add_argument("--out", type=pathlib.Path, help="a folder for scenes, meshes and pictures; else they are not kept")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(CASES)}; all by default")
    arguments = parser.parse_args()
    unknown = set(arguments.scenes) - set(CASES)
    if unknown:
        parser.error(f"unknown scene {', '.join(sorted(unknown))}")
    print("| scene | bytes of the scene file | cell, m | triangles | bytes of the OBJ | seconds as form | as mesh |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.out or pathlib.Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for name in arguments.scenes or CASES:
            print(row(arguments.freelux, name, folder), flush=True)


if __name__ == "__main__":
    main()
