"""Reads what other renderers can be told of a scene file: triangles, MTL materials, camera, surroundings.

Materials mean what docs/materials.md says. Whatever a peer could not be told exactly is refused by name, for a picture of
something else has no error worth measuring.
"""

from dataclasses import dataclass
from pathlib import Path
import tomllib

import numpy as np


class Untranslatable(Exception):
    """The scene has something that another renderer cannot be told."""


@dataclass
class Material:
    """Lambert, metal (GGX without Fresnel) or mirror, and what the front gives off."""

    kind: str
    colour: list[float]
    alpha: float = 0.0
    emission: list[float] | None = None


@dataclass
class Mesh:
    """Triangles of one material: positions (n, 3, 3)."""

    material: Material
    corners: np.ndarray


@dataclass
class Scene:
    name: str
    reference: Path
    size: tuple[int, int]
    eye: np.ndarray
    at: np.ndarray
    up: np.ndarray
    fov: float
    meshes: list[Mesh]
    environment: Path | None
    environment_scale: float


def load(path: Path) -> Scene:
    """Reads a scene file; its reference is `reference.exr` beside it, as for `freelux chart`."""
    with open(path, "rb") as file:
        table = tomllib.load(file)
    unknown = set(table) - {"version", "include", "film", "camera", "environment", "render"}
    if unknown:
        raise Untranslatable(f"{path}: {', '.join(sorted(unknown))}: give a scene of OBJ files, a camera and surroundings")
    for needed in ("camera", "film"):
        if needed not in table:
            raise Untranslatable(f"{path}: there is no [{needed}]")
    meshes = [mesh for name in table.get("include", []) for mesh in load_obj(path.parent / name)]
    surroundings = table.get("environment", {})
    if "radiance" in surroundings:
        raise Untranslatable(f"{path}: surroundings of one radiance; give a picture")
    camera = table["camera"]
    return Scene(
        name=path.parent.name if path.name == "scene.toml" else path.stem,
        reference=path.parent / "reference.exr",
        size=tuple(table["film"]["size"]),
        eye=np.array(camera["eye"], float),
        at=np.array(camera["at"], float),
        up=np.array(camera.get("up", [0, 1, 0]), float),
        fov=camera.get("fov", 40.0),
        meshes=meshes,
        environment=path.parent / surroundings["file"] if "file" in surroundings else None,
        environment_scale=surroundings.get("scale", 1.0),
    )


def load_obj(path: Path) -> list[Mesh]:
    """Reads flat triangles and polygons (fans), a mesh for each material."""
    positions, faces, materials, current = [], {}, {}, None
    for line in path.read_text().splitlines():
        key, *words = line.split() or [""]
        match key:
            case "v":
                positions.append([float(word) for word in words[:3]])
            case "mtllib":
                materials |= load_mtl(path.parent / " ".join(words))
            case "usemtl":
                current = " ".join(words)
            case "f":
                if any(len(word.split("/")) == 3 for word in words):
                    raise Untranslatable(f"{path}: interpolated normals")
                numbers = [int(word.split("/")[0]) for word in words]
                corners = [n - 1 if n > 0 else len(positions) + n for n in numbers]
                fans = [[corners[0], b, c] for b, c in zip(corners[1:], corners[2:])]
                faces.setdefault(current, []).extend(fans)
    points = np.array(positions)
    return [Mesh(materials[name], points[np.array(triangles)]) for name, triangles in faces.items()]


def load_mtl(path: Path) -> dict[str, Material]:
    tables = {}
    for line in path.read_text().splitlines():
        key, *words = line.split() or [""]
        if key == "newmtl":
            tables[" ".join(words)] = table = {}
        elif key and not key.startswith("#"):
            table[key] = words
    return {name: material(f"{path}: {name}", table) for name, table in tables.items()}


def material(name: str, table: dict[str, list[str]]) -> Material:
    """Translates as docs/materials.md has it."""

    def colour(key, otherwise):
        values = [float(word) for word in table.get(key, [otherwise])]
        return values if len(values) == 3 else values * 3

    def number(key, otherwise):
        return float(table[key][0]) if key in table else otherwise

    strange = [key for key in table if key.startswith("map_")]
    strange += ["d"] * (number("d", 1) != 1) + ["Tr"] * (number("Tr", 0) != 0)
    illum, metalness = number("illum", 1), number("Pm", 0)
    strange += ["Ni"] * (illum in (4, 6, 7, 9) and number("Ni", 1) != 1)
    diffuse, specular = colour("Kd", 0 if "Ks" in table or "Ke" in table else 0.5), colour("Ks", 0)
    emission = colour("Ke", 0) if "Ke" in table else None
    rough = "Ns" in table if "Pr" not in table else number("Pr", 0) ** 2 >= 1e-3
    if any(strange):
        raise Untranslatable(f"{name}: {', '.join(strange)}")
    if metalness == 1:
        reflectance = specular if any(specular) else diffuse
        alpha = number("Pr", 0) ** 2 if "Pr" in table else (2 / (number("Ns", 0) + 2)) ** 0.5
        if illum in (5, 7) and rough:
            raise Untranslatable(f"{name}: Schlick's Fresnel term (illum {illum:.0f})")
        kind = "metal" if rough or "Pr" not in table else "mirror"
        return Material(kind, reflectance, max(alpha, 1e-3), emission)
    if illum in (3, 5) and not any(diffuse) and not rough:
        return Material("mirror", specular if "Ks" in table else [1.0] * 3, 0.0, emission)
    if metalness != 0 or any(specular):
        raise Untranslatable(f"{name}: gloss over a diffuse part (Ks, Pm {metalness:g})")
    return Material("diffuse", diffuse, 0.0, emission)
