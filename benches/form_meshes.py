#!/usr/bin/env python3
"""The gallery's free forms beside meshes of them: bytes, processor seconds to load and render, and how the pictures differ, as a table in Markdown.

    cargo build --release -p freelux
    python3 benches/form_meshes.py [--freelux PROGRAM] [--out FOLDER] [SCENE ...]

Each form of a scene becomes one OBJ file by `freelux mesh`, and a copy of the scene names these files in the place of the forms. Both are
rendered by the same command, and once more with another seed: the difference between two pictures of the form is noise, and what the mesh has beyond it is its shape. A form
without bounds stays. Of a form with copies one is meshed, and all are counted: such a scene is not rendered, but the part of it that CUTS names is, with a mesh of every copy.
"""

import argparse
import math
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCENES = ROOT / "cli" / "scenes"
# Cells so small that no facet shows at this size, metres, and what the render command has beside the size.
CASES = {
    "form-textured": (0.015, []),
    "form-figure": (0.02, []),
    "form-glass": (0.0015, []),
    "form-part": (0.015, ["--quality", "0.1"]),
    "form-field": (0.05, ["--quality", "0.3"]),
}
# Parts of scenes whose meshes would take all memory: name, and what is written in the place of what.
CUTS = {
    "form-field": ("400 of them", {"count = [100, 1, 100]": "count = [20, 1, 20]", "translate = [-40, 0, -80]": "translate = [-8, 0, -13]"}),
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


def mesh_scene(freelux, scene, cell, folder, once):
    """Writes the scene with meshes in the place of its forms, `once` without their copies; returns its path, triangles and bytes of OBJ of all copies, and the copies of
    the largest repeat."""
    parts, triangles, size, most, number = [], 0, 0, 1, -1
    for table in tables(scene.read_text()):
        for picture in re.findall(r'^\w*texture = "(.*)"', table, flags=re.MULTILINE):
            shutil.copy(SCENES / picture, folder)
        if not table.startswith("[[form]]"):
            parts.append(table)
            continue
        number += 1
        form = tomllib.loads(table)["form"][0]
        if is_unbounded(form):
            parts.append(table)
            continue
        copies = math.prod(form["repeat"]["count"]) if "repeat" in form else 1
        obj = folder / f"{scene.stem}-{number}.obj"
        run([freelux, "mesh", scene, "--form", str(number), *(["--once"] if once else []), "--cell", str(cell), "--out", obj])
        times = copies if once else 1
        with obj.open("rb") as lines:
            triangles += times * sum(line.startswith(b"f ") for line in lines)
        size += times * obj.stat().st_size
        most = max(most, copies)
        material = f'material = "{form["material"]}"\n' if "material" in form else ""
        parts.append(f'[[mesh]]\nfile = "{obj.name}"\n{material}\n')
    meshed = folder / f"{scene.stem}-mesh.toml"
    meshed.write_text("".join(parts))
    return meshed, triangles, size, most


def flip(freelux, a, b):
    """Returns FLIP between two pictures."""
    told = subprocess.run([freelux, "compare", a, b], stdout=subprocess.PIPE, text=True, check=True).stdout
    return float(re.search(r"^FLIP\s+(\S+)", told, flags=re.MULTILINE | re.IGNORECASE).group(1))


def row(freelux, name, scene, folder, once):
    """Returns a line of the table; `once` meshes one copy of each form and renders only scenes that have no more."""
    cell, options = CASES[scene.stem.removesuffix("-cut")]
    meshed, triangles, size, copies = mesh_scene(freelux, scene, cell, folder, once)

    def render(path, suffix, seed):
        out = folder / f"{scene.stem}-{suffix}.exr"
        return out, run([freelux, "render", path, "--size", SIZE, "--seed", seed, *options, "--out", out])

    own = scene.stat().st_size
    form, form_seconds = render(scene, "form", "0")
    mesh_seconds, difference = "not rendered", "-"
    if copies == 1 or not once:
        again, _ = render(scene, "again", "1")
        mesh, seconds = render(meshed, "mesh", "1")
        mesh_seconds = f"{seconds:.1f}"
        difference = f"{flip(freelux, mesh, form):.3f}, noise {flip(freelux, again, form):.3f}"
    command = f" (`{' '.join(options)}`)" if options else ""
    return (f"| {name} | {own} | {cell} | {triangles} | {size} ({size / own:.0f} times) | {form_seconds:.1f}{command} | "
            f"{mesh_seconds} | {difference} |")


def cut(scene, changes, folder):
    """Writes a part of a scene; returns its path."""
    text = scene.read_text()
    for old, new in changes.items():
        text = text.replace(old, new)
    part = folder / f"{scene.stem}-cut.toml"
    part.write_text(text)
    return part


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--freelux", default=ROOT / "target" / "release" / "freelux", help="the program")
    parser.add_argument("--out", type=pathlib.Path, help="a folder for scenes, meshes and pictures; else they are not kept")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(CASES)}; all by default")
    arguments = parser.parse_args()
    unknown = set(arguments.scenes) - set(CASES)
    if unknown:
        parser.error(f"unknown scene {', '.join(sorted(unknown))}")
    print("| scene | bytes of the scene file | cell, m | triangles | bytes of the OBJ | seconds as form | as mesh | FLIP |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.out or pathlib.Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for name in arguments.scenes or CASES:
            scene = SCENES / f"{name}.toml"
            print(row(arguments.freelux, name, scene, folder, True), flush=True)
            if name in CUTS:
                what, changes = CUTS[name]
                print(row(arguments.freelux, f"{name}, {what}", cut(scene, changes, folder), folder, False), flush=True)


if __name__ == "__main__":
    main()
