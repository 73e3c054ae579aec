# SPDX-License-Identifier: Apache-2.0
"""ray_tracing/path_tracer against Mitsuba 3 on five scenes of one and the same reflection model.

usage: path_tracer_mitsuba.py [--samples N] [--size PIXELS] [--variant llvm_ad_rgb|scalar_rgb] [--folder DIR] [SCENE ...]

Wants mitsuba, numpy and scipy from PyPI: without mitsuba it makes a virtual environment in --folder, installs them there,
and goes on in it. PYTHONPATH must hold scripts/. The model (GGX with height-correlated shadowing, Schlick's Fresnel term,
a diffuse layer that takes what is left) is written down again here for Mitsuba from its equations, with albedos of its own
quadrature; everything else - rays, emitters, sampling - is Mitsuba's.

Prints for each scene: the mean of both and how far they are apart; the largest |t| of 4 x 4 blocks of pixels and its limit
(Bonferroni, a chance of 1e-3 for all); the share of single pixels beyond |t| = 3 and what Student's distribution expects;
processor time of both (all threads, rendered in turns, the median of REPLICATES times as many), and their ratio to equal
relMSE. Exit status 1 if a scene disagrees.
"""
import argparse
import functools
import os
import pathlib
import subprocess
import sys
import time

SIZE = 64
REPLICATES = 8  # renderings of each side, from which its variance is known


def ensure_packages(folder: pathlib.Path) -> None:
    """Goes on in a virtual environment that has what is missing here; returns if nothing is."""
    try:
        import mitsuba  # noqa: F401
        import scipy  # noqa: F401
        return
    except ImportError:
        pass
    python = folder / "venv" / "bin" / "python"
    if os.environ.get("HEDDLE_MITSUBA_VENV"):
        sys.exit("mitsuba and scipy could not be installed into " + str(folder))
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "-q", "mitsuba", "numpy", "scipy"], check=True)
    os.environ["HEDDLE_MITSUBA_VENV"] = "1"
    os.execv(python, [str(python), *sys.argv])


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--samples", type=int, default=512)
    parser.add_argument("--size", type=int, default=SIZE)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("out/path_tracer_mitsuba"))
    parser.add_argument("--points", default="sobol", choices=("sobol", "independent"))
    return parser.parse_args()


ARGUMENTS = read_arguments()
ensure_packages(ARGUMENTS.folder)

import mitsuba as mi  # noqa: E402
import numpy as np  # noqa: E402
import scipy.stats  # noqa: E402

import heddle  # noqa: E402
from heddle import shapes  # noqa: E402

mi.set_variant(ARGUMENTS.variant)
import drjit as dr  # noqa: E402

# Called for each point of a path, Python would be all that is measured: there Mitsuba's own, similar, models stand in, and
# only times and errors mean something.
IS_SCALAR = ARGUMENTS.variant.startswith("scalar")
GRID = 256  # cosines of the albedo tables


@functools.cache
def albedos(roughness: float) -> np.ndarray:
    """E and E_schlick of single scattering at GRID cosines from 0 to 1: (2, GRID) float64.

    Means of G2 / G1 over visible normals (Heitz 2018) at 64 x 64 midpoints; with Fresnel weight (1 - VoH)^5 the second.
    """
    alpha = max(roughness, 1e-3**0.5) ** 2
    u = (np.arange(64) + 0.5) / 64
    r, phi = np.meshgrid(np.sqrt(u), 2 * np.pi * u)
    t1, t2 = r * np.cos(phi), r * np.sin(phi)
    table = np.zeros((2, GRID))
    for i, cosine in enumerate(np.maximum(np.linspace(0, 1, GRID), 1e-4)):
        sine = np.sqrt(1 - cosine * cosine)
        length = np.hypot(alpha * sine, cosine)
        vx, vz = alpha * sine / length, cosine / length
        s = 0.5 * (1 + vz)
        p2 = (1 - s) * np.sqrt(1 - t1 * t1) + s * t2
        p3 = np.sqrt(np.maximum(1 - t1 * t1 - p2 * p2, 0))
        h = np.stack([alpha * (p3 * vx - p2 * vz), alpha * t1, np.maximum(p2 * vx + p3 * vz, 0)])
        h /= np.sqrt((h * h).sum(0))
        voh = h[0] * sine + h[2] * cosine
        nol = 2 * voh * h[2] - cosine
        lit = nol > 0
        lam = [0.5 * (np.sqrt(1 + alpha**2 * (1 - c * c) / (c * c)) - 1) for c in (cosine, np.where(lit, nol, 1))]
        weight = np.where(lit, (1 + lam[0]) / (1 + lam[0] + lam[1]), 0)
        table[0, i] = weight.mean()
        table[1, i] = (weight * (1 - voh) ** 5).mean()
    return table


class Surface(mi.BSDF):
    """Equations (1) to (3), (8) and (9) of surface_material/ggx's README, without (7)."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.color = mi.Color3f(props["color"])
        self.metalness, roughness, ior = props["metalness"], props["roughness"], props["ior"]
        self.alpha = max(roughness, 1e-3**0.5) ** 2
        self.f0 = ((ior - 1) / (ior + 1)) ** 2
        e, es = albedos(roughness)
        # The diffuse layer leaves out what compensated specular reflection takes.
        c = np.linspace(0, 1, GRID)
        mean_e, mean_es = (2 * np.trapezoid(x * c, c) for x in (e, es))
        favg = (20 * self.f0 + 1) / 21
        share = favg**2 * mean_e / (1 - favg * (1 - mean_e))
        taken = lambda a, b: self.f0 * a + (1 - self.f0) * b + share * (1 - a)  # noqa: E731
        self.left = mi.Float((1 - taken(e, es)).astype(np.float32))
        self.left_mean = float(1 - taken(mean_e, mean_es))
        self.m_flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
        self.m_components = [self.m_flags]

    def left_at(self, cosine):
        x = dr.clip(cosine, 0, 1) * (GRID - 1)
        i = dr.minimum(mi.UInt32(x), GRID - 2)
        a, b = dr.gather(mi.Float, self.left, i), dr.gather(mi.Float, self.left, i + 1)
        return dr.fma(b - a, x - mi.Float(i), a)

    def f_cos(self, wi, wo):
        nov, nol = wi.z, wo.z
        h = dr.normalize(wi + wo)
        a2 = self.alpha**2
        k = self.alpha / dr.maximum(h.x * h.x + h.y * h.y + h.z * h.z * a2, 1e-20)
        d = k * k * dr.inv_pi
        v = 0.5 / dr.maximum(nol * dr.sqrt(a2 + nov * nov * (1 - a2)) + nov * dr.sqrt(a2 + nol * nol * (1 - a2)), 1e-12)
        f0 = dr.lerp(mi.Color3f(self.f0), self.color, self.metalness)
        voh = dr.clip(dr.dot(wi, h), 0, 1)
        f = f0 + (1 - f0) * (1 - voh) ** 5
        diffuse = self.color * ((1 - self.metalness) * dr.inv_pi * self.left_at(nov) * self.left_at(nol) / self.left_mean)
        return (f * d * v + diffuse) * nol

    def density(self, wi, wo):
        h = dr.normalize(wi + wo)
        a2 = self.alpha**2
        k = self.alpha / dr.maximum(h.x * h.x + h.y * h.y + h.z * h.z * a2, 1e-20)
        visible = k * k * dr.inv_pi * 0.5 / (wi.z + dr.sqrt(a2 + wi.z * wi.z * (1 - a2)))
        share = 0.5 + 0.5 * self.metalness
        return share * visible + (1 - share) * wo.z * dr.inv_pi

    def sample(self, ctx, si, sample1, sample2, active=True):
        wi = si.wi
        share = 0.5 + 0.5 * self.metalness
        distribution = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, True)
        h, _ = distribution.sample(wi, sample2)
        wo = dr.select(sample1 < share, mi.reflect(wi, h), mi.warp.square_to_cosine_hemisphere(sample2))
        active &= (wi.z > 0) & (wo.z > 0)
        pdf = dr.select(active, self.density(wi, wo), 0)
        active &= pdf > 0
        bs = mi.BSDFSample3f()
        bs.wo, bs.pdf, bs.eta = wo, pdf, 1.0
        bs.sampled_type = mi.UInt32(+self.m_flags)
        bs.sampled_component = mi.UInt32(0)
        return bs, dr.select(active, self.f_cos(wi, wo) / dr.maximum(pdf, 1e-20), mi.Color3f(0))

    def eval(self, ctx, si, wo, active=True):
        active &= (si.wi.z > 0) & (wo.z > 0)
        return dr.select(active, self.f_cos(si.wi, wo), mi.Color3f(0))

    def pdf(self, ctx, si, wo, active=True):
        active &= (si.wi.z > 0) & (wo.z > 0)
        return dr.select(active, self.density(si.wi, wo), 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)


if not IS_SCALAR:
    mi.register_bsdf("heddle_surface", Surface)

EYE, TARGET, ANGLE = (0.0, 1.0, 3.6), (0.0, 0.9, 0.0), 0.75


class Both:
    """One scene for both renderers."""

    def __init__(self, scene, sky=(0.0, 0.0, 0.0)):
        self.scene, self.sky = scene, sky
        self.mitsuba = {"type": "scene"}
        if max(sky) > 0:
            self.mitsuba["sky"] = {"type": "constant", "radiance": {"type": "rgb", "value": list(sky)}}

    def add(self, shape, color=(0.5, 0.5, 0.5), metalness=0.0, roughness=1.0, ior=1.5, emissive=None, coverage=1.0, stripes=None):
        options = {}
        if stripes is not None:
            pixels = np.full((1, len(stripes), 4), 255, np.uint8)
            pixels[0, :, :3] = 255 * np.asarray(stripes)[:, None]
            options["emissive_texture"] = self.scene.texture(pixels, nearest=True)
        material = self.scene.material(None, (*color, coverage), metalness=metalness, roughness=roughness, ior=ior,
                                       double_sided=emissive is None, emissive=emissive or (0, 0, 0),
                                       alpha_mode="blend" if coverage < 1 else "opaque", **options)
        self.scene.instance(self.scene.mesh(material=material, **shape))
        mesh = mi.Mesh("mesh", len(shape["positions"]), len(shape["indices"].ravel()) // 3, has_vertex_texcoords=True,
                       props=self.properties(color, metalness, roughness, ior, emissive, coverage, stripes))
        values = mi.traverse(mesh)
        for key, numbers, kind in (("vertex_positions", shape["positions"], np.float32),
                                   ("vertex_texcoords", shape["uv0"], np.float32), ("faces", shape["indices"], np.uint32)):
            values[key] = type(values[key])(np.asarray(numbers, kind).ravel())
        values.update()
        self.mitsuba[f"shape{len(self.mitsuba)}"] = mesh

    @staticmethod
    def properties(color, metalness, roughness, ior, emissive, coverage, stripes):
        rgb = {"type": "rgb", "value": list(color)}
        if not IS_SCALAR:
            bsdf = {"type": "heddle_surface", "color": mi.ScalarColor3f(*color), "metalness": metalness,
                    "roughness": roughness, "ior": ior}
        elif metalness > 0:
            bsdf = {"type": "roughconductor", "material": "none", "alpha": roughness**2, "distribution": "ggx",
                    "specular_reflectance": rgb}
        elif ior > 1:
            bsdf = {"type": "roughplastic", "alpha": roughness**2, "int_ior": ior, "distribution": "ggx",
                    "diffuse_reflectance": rgb}
        else:
            bsdf = {"type": "diffuse", "reflectance": rgb}
        bsdf = {"type": "twosided", "nested": bsdf}
        if coverage < 1:
            bsdf = {"type": "mask", "opacity": coverage, "nested": bsdf}
        props = mi.Properties()
        props["mesh_bsdf"] = mi.load_dict(bsdf)
        if emissive is not None:
            radiance = {"type": "rgb", "value": list(emissive)}
            if stripes is not None:
                # Four rows of the same: images of a single one are filtered when they are loaded.
                data = np.tile(np.asarray(stripes, np.float32)[None, :, None] * np.asarray(emissive, np.float32), (4, 1, 1))
                radiance = {"type": "bitmap", "data": mi.TensorXf(data), "raw": True, "filter_type": "nearest"}
            props["mesh_emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
        return props


def room(both, **surface):
    both.add(shapes.quad((-1.5, 0, 1.5), (3, 0, 0), (0, 0, -3)), (0.7, 0.7, 0.7), **surface)
    both.add(shapes.quad((-1.5, 0, -1.5), (3, 0, 0), (0, 2.4, 0)), (0.7, 0.65, 0.5), **surface)
    both.add(shapes.quad((-1.5, 0, 1.5), (0, 0, -3), (0, 2.4, 0)), (0.7, 0.1, 0.1), **surface)


def block(shape_size, place, turn):
    shape = shapes.box(shape_size)
    matrix = (shapes.translation(*place) @ shapes.rotation_y(turn))[:3]
    positions = np.asarray(shape["positions"]) @ matrix[:, :3].T + matrix[:, 3]
    return {**shape, "positions": positions, "normals": np.asarray(shape["normals"]) @ matrix[:, :3].T}


LAMP = shapes.quad((-0.4, 2.2, -0.4), (0.8, 0, 0), (0, 0, 0.8))  # faces down
BLOCKS = (block((0.7, 1.2, 0.7), (-0.5, 0.6, -0.5), 0.4), block((0.6, 0.6, 0.6), (0.6, 0.3, 0.3), -0.3))


def diffuse(both):
    room(both, roughness=1.0, ior=1.0)
    for shape in BLOCKS:
        both.add(shape, (0.6, 0.6, 0.6), ior=1.0)
    both.add(LAMP, (0, 0, 0), ior=1.0, emissive=(6, 5, 4))


def conductor(both):
    room(both, roughness=0.5, metalness=1.0)
    both.add(BLOCKS[0], (0.9, 0.7, 0.3), metalness=1.0, roughness=0.25)
    both.add(BLOCKS[1], (0.9, 0.9, 0.9), metalness=1.0, roughness=0.6)
    both.add(LAMP, (0, 0, 0), ior=1.0, emissive=(6, 5, 4))


def dielectric(both):
    room(both, roughness=0.6)
    both.add(BLOCKS[0], (0.2, 0.3, 0.6), roughness=0.2)
    both.add(BLOCKS[1], (0.5, 0.5, 0.1), roughness=0.35, ior=2.0)
    both.add(LAMP, (0, 0, 0), ior=1.0, emissive=(6, 5, 4))


def emitters(both):
    room(both, roughness=0.8)
    for shape in BLOCKS:
        both.add(shape, (0.6, 0.6, 0.6), roughness=0.4)
    both.add(LAMP, (0, 0, 0), ior=1.0, emissive=(3, 2, 2))
    window = shapes.quad((1.2, 0.4, -0.5), (0, 0, 1.4), (0, 0.9, 0))
    # Mitsuba draws points of textured emitters by texture coordinates, once over [0, 1]^2: what repeats it does not find.
    window["uv0"] = window["uv0"] / np.array([1.4, 0.9])
    both.add(window, (0, 0, 0), ior=1.0, emissive=(4, 6, 8), stripes=(1, 0, 1, 1, 0, 0, 1, 0))


def alpha(both):
    room(both, roughness=0.9)
    both.add(BLOCKS[0], (0.6, 0.6, 0.6), roughness=0.7)
    both.add(shapes.quad((0.1, 0.2, 0.6), (0.9, 0, 0.2), (0, 1.1, 0)), (0.2, 0.7, 0.3), roughness=0.5, coverage=0.5)
    both.add(shapes.quad((-0.8, 1.7, -0.9), (1.6, 0, 0), (0, 0, 1.6)), (0.8, 0.3, 0.2), roughness=0.9, coverage=0.25)
    both.add(LAMP, (0, 0, 0), ior=1.0, emissive=(8, 8, 8))


SCENES = {"diffuse": (diffuse, (0, 0, 0)), "conductor": (conductor, (0.2, 0.2, 0.2)), "dielectric": (dielectric, (0.1, 0.1, 0.1)),
          "emitters": (emitters, (0.3, 0.4, 0.6)), "alpha": (alpha, (0.2, 0.2, 0.2))}


def graph_file(folder, samples, sky):
    file = folder / "path_tracer.toml"
    file.write_text(f"""extent = [{ARGUMENTS.size}, {ARGUMENTS.size}]
output = "pt.radiance"
[[pass]]
role = "sky"
technique = "uniform"
params.radiance = {list(map(float, sky))}
[[pass]]
role = "surface_material"
technique = "ggx"
params.multiple_scattering = false
[[pass]]
name = "pt"
role = "ray_tracing"
technique = "path_tracer"
params.samples = {samples}
params.multiple_scattering = false
params.points = "{ARGUMENTS.points}"
""")
    return file


def timed(work):
    """What work() returns, and the processor time it took in all threads [s]."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def summarize(images):
    """Mean and variance of the mean of REPLICATES renderings: both (height, width, 3) float64."""
    images = np.asarray(images, np.float64)
    return images.mean(0), images.var(0, ddof=1) / len(images)


def rel_mse(mean, variance):
    return float((variance / (mean**2 + 1e-2)).mean())


def compare(name):
    build, sky = SCENES[name]
    part = max(ARGUMENTS.samples // REPLICATES, 1)
    with heddle.Host() as host, host.scene() as scene:
        both = Both(scene, sky)
        build(both)
        scene.camera(EYE, TARGET, vertical_angle=ANGLE)
        mitsuba_scene = dict(both.mitsuba)
        mitsuba_scene["integrator"] = {"type": "path", "max_depth": -1, "rr_depth": 5}
        mitsuba_scene["sensor"] = {
            "type": "perspective", "fov": float(np.degrees(ANGLE)), "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(EYE, TARGET, (0, 1, 0)),
            "film": {"type": "hdrfilm", "width": ARGUMENTS.size, "height": ARGUMENTS.size, "rfilter": {"type": "box"},
                     "pixel_format": "rgb", "component_format": "float32"},
            "sampler": {"type": "independent", "sample_count": part}}
        loaded = mi.load_dict(mitsuba_scene)
        ours, theirs, our_cpu, their_cpu = [], [], [], []
        with host.graph(str(graph_file(ARGUMENTS.folder, part, sky))) as graph:
            def render_ours(seed):
                graph.render(scene, seed=seed)
                return graph.read()[..., :3].copy()

            def render_theirs(seed):
                return np.array(mi.render(loaded, spp=part, seed=seed))

            # What is made and compiled once.
            render_ours(1000)
            render_theirs(1000)
            # In turns, so that what else the machine does meets both.
            for seed in range(REPLICATES):
                for render, images, cpu in ((render_ours, ours, our_cpu), (render_theirs, theirs, their_cpu)):
                    image, seconds = timed(lambda: render(seed))  # noqa: B023
                    images.append(image)
                    cpu.append(seconds)
        host.write_image(ARGUMENTS.folder / f"{name}_heddle.exr", np.mean(ours, 0).astype(np.float32))
        host.write_image(ARGUMENTS.folder / f"{name}_mitsuba.exr", np.mean(theirs, 0).astype(np.float32))
    a, va = summarize(ours)
    b, vb = summarize(theirs)
    mean_a, mean_b = a.mean(), b.mean()
    error = np.sqrt((va.sum() + vb.sum())) / a.size
    # Replicates of both sides; blocks add degrees of freedom.
    freedom = 2 * (REPLICATES - 1)
    t = (a - b) / np.sqrt(va + vb + (1e-6 * (a + b)) ** 2 + 1e-20)
    n = ARGUMENTS.size // 4 * 4
    blocks = lambda x: x[:n, :n].reshape(n // 4, 4, n // 4, 4, 3).sum((1, 3))  # noqa: E731
    t_block = blocks(a - b) / np.sqrt(blocks(va + vb) + (1e-6 * blocks(a + b)) ** 2 + 1e-20)
    limit = scipy.stats.t.isf(0.5e-3 / t_block.size, 4 * freedom)
    mean_off = abs(mean_a - mean_b)
    is_right = (mean_off <= max(5e-3 * mean_b, 3 * error)) and np.abs(t_block).max() <= limit
    our_cpu, their_cpu = REPLICATES * np.median(our_cpu), REPLICATES * np.median(their_cpu)
    efficiency = (rel_mse(b, vb) * their_cpu) / (rel_mse(a, va) * our_cpu)
    print(f"{name:11s} mean {mean_a:.5f} {mean_b:.5f} ({100 * (mean_a / mean_b - 1):+.3f} %, {(mean_a - mean_b) / error:+.2f} s.e.)"
          f"  blocks |t| {np.abs(t_block).max():.2f} of {limit:.2f}  pixels beyond 3: {100 * (np.abs(t) > 3).mean():.2f} %"
          f" of {100 * 2 * scipy.stats.t.sf(3, freedom):.2f} %  cpu {our_cpu:.2f} s {their_cpu:.2f} s"
          f"  relMSE {rel_mse(a, va):.3g} {rel_mse(b, vb):.3g}  time to equal relMSE, theirs over ours {efficiency:.2f}"
          f"  {'other models' if IS_SCALAR else 'agree' if is_right else 'DISAGREE'}", flush=True)
    return is_right or IS_SCALAR


def main() -> int:
    ARGUMENTS.folder.mkdir(parents=True, exist_ok=True)
    print(f"Mitsuba {mi.__version__} {ARGUMENTS.variant}, {ARGUMENTS.size} x {ARGUMENTS.size}, {ARGUMENTS.samples} paths a pixel of both")
    return 0 if all([compare(name) for name in ARGUMENTS.scenes or SCENES]) else 1


if __name__ == "__main__":
    sys.exit(main())
