"""Mitsuba 3: its path tracer (next-event estimation, multiple importance sampling, unlimited length), with OIDN or without."""

import time

import drjit as dr
import mitsuba as mi
import numpy as np

from scene import Scene

# Rendered in passes of so many samples a pixel: more would need gigabytes.
PASS = 64
# Albedo and normals for the denoiser need no more samples: they have no noise inside of surfaces.
AUXILIARY_SAMPLES = 16


class Mitsuba:
    """A scene in Mitsuba, its kernels compiled."""

    name = "mitsuba-path"
    qualities = [4, 16, 64, 256, 1024, 4096]
    growth = 4

    def __init__(self, scene: Scene, threads: int, sampler: str, denoise: bool = False):
        mi.set_variant("llvm_ad_rgb")
        mi.set_log_level(mi.LogLevel.Error)
        dr.set_thread_count(threads)
        self.size = scene.size
        self.denoise = denoise
        self.scene = mi.load_dict(description(scene, sampler))
        # By itself: around the path tracer, the same integrator takes twice the path tracer's time.
        self.auxiliary = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})
        self.warm = set()
        self.version = f"mitsuba {mi.__version__} llvm_ad_rgb {sampler}"
        if denoise:
            self.name = "mitsuba-path-oidn"
            import pyoidn

            self.version += f", oidn {pyoidn.version.oidn_version}"
            flat = np.ones((16, 16, 3), np.float32)
            pyoidn.denoise(flat, flat, flat, hdr=True)

    def render(self, quality: float, seed: int) -> tuple[np.ndarray, float]:
        """Returns a picture of `quality` samples a pixel and its seconds, without loading and compiling."""
        spp = int(quality)
        step = min(spp, PASS)
        if step not in self.warm:
            np.array(mi.render(self.scene, spp=step, seed=seed + 1_000_003))
            self.guides(step, seed)
            self.warm.add(step)
        start = time.perf_counter()
        total = 0
        for number in range(spp // step):
            # Seeds of passes and pictures must not meet.
            total = total + np.array(mi.render(self.scene, spp=step, seed=seed * 65_536 + number), np.float64)
        picture = (total / (spp // step)).astype(np.float32)
        if self.denoise:
            import pyoidn

            albedo, normal = self.guides(step, seed)
            picture = pyoidn.denoise(picture, albedo, normal, hdr=True)
        return picture, time.perf_counter() - start

    def guides(self, step: int, seed: int) -> list[np.ndarray]:
        """Returns pictures of albedo and normal, where a denoiser asks for them."""
        if not self.denoise:
            return []
        both = np.array(mi.render(self.scene, integrator=self.auxiliary, spp=min(step, AUXILIARY_SAMPLES), seed=seed))
        albedo, normal = (np.ascontiguousarray(both[..., i : i + 3]) for i in (0, 3))
        return [np.clip(albedo, 0, 1), normal]


def description(scene: Scene, sampler: str) -> dict:
    """Returns the scene as Mitsuba wants it."""
    parts = {
        "type": "scene",
        "integrator": {"type": "path"},
        "sensor": {
            "type": "perspective",
            "fov": scene.fov,
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(origin=scene.eye, target=scene.at, up=scene.up),
            "sampler": {"type": sampler},
            "film": {
                "type": "hdrfilm",
                "width": scene.size[0],
                "height": scene.size[1],
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
        },
    }
    for number, mesh in enumerate(scene.meshes):
        parts[f"mesh{number}"] = shape(mesh)
    if scene.environment:
        bitmap = surroundings(scene)
        parts["environment"] = {"type": "envmap", "bitmap": bitmap, "scale": scene.environment_scale}
    return parts


def rgb(values) -> dict:
    return {"type": "rgb", "value": list(values)}


def shape(mesh) -> mi.Mesh:
    """Returns flat triangles that share no corner, so that their normals are their own."""
    material = mesh.material
    match material.kind:
        case "diffuse":
            bsdf = {"type": "diffuse", "reflectance": rgb(material.colour)}
        case "metal":
            bsdf = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": material.alpha}
            bsdf["specular_reflectance"] = rgb(material.colour)
        case "mirror":
            bsdf = {"type": "conductor", "material": "none", "specular_reflectance": rgb(material.colour)}
    properties = mi.Properties()
    properties["face_normals"] = True
    properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": bsdf})
    if material.emission:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": rgb(material.emission)})
    count = len(mesh.corners)
    result = mi.Mesh("mesh", 3 * count, count, props=properties)
    params = mi.traverse(result)
    params["vertex_positions"] = mesh.corners.astype(np.float32).ravel()
    params["faces"] = np.arange(3 * count, dtype=np.uint32)
    params.update()
    return result


def surroundings(scene: Scene) -> mi.Bitmap:
    """Returns the picture with rows between its rows, so that Mitsuba's look-up at v (H - 1) finds what one at v H - 1/2 finds here."""
    rows = np.array(mi.Bitmap(str(scene.environment)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    height = len(rows)
    fine = np.empty((2 * height + 1, *rows.shape[1:]), np.float32)
    fine[1::2] = rows
    fine[2:-1:2] = (rows[:-1] + rows[1:]) / 2
    fine[0], fine[-1] = rows[0], rows[-1]
    return mi.Bitmap(fine)
