"""Radiance: its ambient cache for diffuse light, sources sampled with jitter.

Surroundings are a `glow`, which the ambient rays find, as Radiance does with a sky; the sun in them is cut out and becomes a
`light`, which is sampled. Its gloss is Ward's and not GGX: scenes with gloss are refused.
"""

import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pyradiance

from scene import Scene, Untranslatable

# What is brighter than the 99th of 100 pixels by this factor is the sun.
SUN_FACTOR = 4.0
# Accuracy, resolution and divisions of the ambient cache, rays a pixel: few records with many rays each were the quickest way to any error
# in cornell; super-samples (-as) and a first pass of more pixels gained nothing.
LEVELS = {
    1: (0.4, 8, 64, 4),
    2: (0.3, 8, 128, 16),
    3: (0.3, 8, 256, 16),
    4: (0.3, 8, 512, 36),
    5: (0.2, 16, 1024, 64),
    6: (0.15, 32, 2048, 144),
}
# Light is followed over so many diffuse reflections.
BOUNCES = 10


class Radiance:
    """A scene as an octree."""

    name = "radiance"
    qualities = list(LEVELS)
    growth = 2

    def __init__(self, scene: Scene, threads: int):
        self.scene = scene
        self.threads = threads
        self.folder = tempfile.TemporaryDirectory()
        home = Path(pyradiance.__file__).parent
        self.bin = home / "bin"
        self.environment = os.environ | {"RAYPATH": f"{self.folder.name}:{home / 'lib'}"}
        self.version = "radiance of pyradiance " + pyradiance.__version__
        file = Path(self.folder.name)
        (file / "scene.rad").write_text(description(scene, file))
        with open(file / "scene.oct", "wb") as octree:
            self.run(["oconv", "scene.rad"], stdout=octree)

    def run(self, command: list, **options) -> bytes:
        command = [self.bin / command[0], *map(str, command[1:])]
        options = {"stdout": subprocess.PIPE} | options
        done = subprocess.run(command, cwd=self.folder.name, env=self.environment, check=True, **options)
        return done.stdout

    def render(self, quality: float, seed: int) -> tuple[np.ndarray, float]:
        """Returns the picture and its seconds: a first pass over every fourth pixel fills the cache, the second one is seen."""
        accuracy, resolution, divisions, rays = LEVELS[int(quality)]
        (Path(self.folder.name) / "cache.amb").unlink(missing_ok=True)
        options = ["-n", self.threads, "-h", "-w", "-ff", "-u+", "-ab", BOUNCES, "-aa", accuracy, "-ad", divisions]
        options += ["-as", 0, "-ar", resolution, "-lw", 0.1 / divisions, "-lr", -BOUNCES, "-dj", 1, "-ds", 0.2, "-dt", 0]
        command = ["rtrace", *options, "-af", "cache.amb", "scene.oct"]
        generator = np.random.default_rng(seed)
        width, height = self.scene.size
        coarse = camera_rays(self.scene, 1, generator).reshape(height, width, 6)[::4, ::4]
        fine = camera_rays(self.scene, rays, generator)
        start = time.perf_counter()
        self.run(command, input=np.ascontiguousarray(coarse).tobytes())
        radiance = np.frombuffer(self.run(command, input=fine.tobytes()), np.float32)
        picture = radiance.reshape(rays, height, width, 3).mean(0, dtype=np.float64)
        return picture.astype(np.float32), time.perf_counter() - start


def camera_rays(scene: Scene, count: int, generator) -> np.ndarray:
    """Returns origins and directions, `count` for each pixel at random places in it."""
    width, height = scene.size
    forward = scene.at - scene.eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, scene.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    y, x = np.mgrid[:height, :width]
    x = (x + generator.random((count, height, width))) / width * 2 - 1
    y = 1 - (y + generator.random((count, height, width))) / height * 2
    slope = np.tan(np.radians(scene.fov) / 2)
    directions = forward + right * (x * slope * width / height)[..., None] + up * (y * slope)[..., None]
    rays = np.empty((count, height, width, 6), np.float32)
    rays[..., :3] = scene.eye
    rays[..., 3:] = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    return rays


def description(scene: Scene, folder: Path) -> str:
    """Returns the scene in Radiance's language; the picture of the sky goes to `folder`."""
    lines = []
    for number, mesh in enumerate(scene.meshes):
        if mesh.material.kind != "diffuse":
            raise Untranslatable(f"{scene.name}: Radiance has no {mesh.material.kind} of the same kind")
        if mesh.material.emission:
            lines.append(f"void light m{number} 0 0 3 {numbers(mesh.material.emission)}")
        else:
            lines.append(f"void plastic m{number} 0 0 5 {numbers(mesh.material.colour)} 0 0")
        for index, triangle in enumerate(mesh.corners):
            lines.append(f"m{number} polygon m{number}t{index} 0 0 9 {numbers(triangle.ravel())}")
    if scene.environment:
        lines += surroundings(scene, folder)
    return "\n".join(lines) + "\n"


def surroundings(scene: Scene, folder: Path) -> list[str]:
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant("scalar_rgb")
    picture = mi.Bitmap(str(scene.environment)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    radiance = np.array(picture, np.float64) * scene.environment_scale
    height, width, _ = radiance.shape
    mean = radiance.mean(2)
    sun = mean > SUN_FACTOR * np.percentile(mean, 99)
    lines = []
    if sun.any():
        rest = radiance * (mean[~sun].max() / np.maximum(mean, 1e-9))[..., None]
        above = np.where(sun[..., None], radiance - rest, 0)
        radiance -= above
        polar = np.pi * (np.arange(height) + 0.5) / height
        turn = 2 * np.pi * (np.arange(width) + 0.5) / width
        solid_angles = (2 * np.pi / width * np.pi / height) * np.sin(polar)[:, None] * np.ones(width)
        flux = (above * solid_angles[..., None]).sum((0, 1))
        # A disc as large as the sun's pixels, those of its rim by their share.
        size = (above.mean(2) / above.mean(2).max() * solid_angles).sum()
        sine = np.sin(polar)[:, None]
        directions = np.stack([sine * np.sin(turn), np.cos(polar)[:, None] + 0 * turn, -sine * np.cos(turn)], -1)
        towards = (directions * (above.mean(2) * solid_angles)[..., None]).sum((0, 1))
        angle = 2 * np.degrees(np.arccos(1 - size / (2 * np.pi)))
        lines.append(f"void light sun 0 0 3 {numbers(flux / size)}")
        lines.append(f"sun source sun_disc 0 0 4 {numbers(towards / np.linalg.norm(towards))} {angle:.9g}")
    mi.Bitmap(radiance.astype(np.float32)).write(str(folder / "sky.hdr"))
    # A picture's shorter side is 1, its origin the lower left corner.
    across, down = max(1, width / height), max(1, height / width)
    turn = "atan2(Dx, -Dz) / (2 * PI)"
    (folder / "sky.cal").write_text(
        f"turn = {turn};\nsky_u = {across} * (turn - floor(turn));\nsky_v = {down} * (1 - acos(Dy) / PI);\n"
    )
    lines.append("void colorpict sky_picture 7 red green blue sky.hdr sky.cal sky_u sky_v 0 0")
    lines.append("sky_picture glow sky 0 0 4 1 1 1 0")
    lines.append("sky source sky_dome 0 0 4 0 1 0 360")
    return lines


def numbers(values) -> str:
    return " ".join(f"{value:.9g}" for value in values)
