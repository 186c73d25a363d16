"""Render scene.xml, which Insitu exported beside this file, with Mitsuba 3 (pip install mitsuba).

    python render.py [--output render.exr] [--samples 256] [--variant llvm_ad_rgb] [--size WIDTH HEIGHT]

Materials that Mitsuba has no model for are of the type "insitu": tables of their BRDF, which this file teaches it to
read. Variants that take them: llvm_ad_rgb (the processor; needs LLVM) and cuda_ad_rgb.
"""

# mypy: ignore-errors

import argparse
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent


def insitu_bsdf(mi, dr):
    """The class of the type "insitu"; made once the variant is chosen."""

    class Factor:
        """What multiplies one table: the product of images, each in its own mapping, and of the colours of vertices."""

        def __init__(self, data, k):
            self.has_colours, self.images = bool(data[f"vertex_colours_{k}"]), []
            while f"image_{k}_{len(self.images)}" in data:
                texels, matrix, wrap = (data[f"{name}_{k}_{len(self.images)}"] for name in ("image", "matrix", "wrap"))
                self.images.append((texels.shape[:2], mi.Float(texels.astype(np.float32).ravel()), matrix, wrap))

        def at(self, si, active):
            value = mi.Color3f(1)
            if self.has_colours:
                value *= si.shape.eval_attribute_3("vertex_color", si, active)
            for (height, width), image, ((a, b, c), (d, e, f)), (wrap_u, wrap_v) in self.images:
                u, v = (float(x) * si.uv.x + float(y) * si.uv.y + float(z) for x, y, z in ((a, b, c), (d, e, f)))
                texel = mi.Color3f(0)
                rows = texels(1 - within(v, wrap_v), height, wrap_v == 0)
                columns = texels(within(u, wrap_u), width, wrap_u == 0)
                for (column, across), (row, down) in ((x, y) for x in columns for y in rows):
                    texel += across * down * dr.gather(mi.Color3f, image, row * width + column, active)
                value *= texel
            return value

    class Insitu(mi.BSDF):
        """A BRDF by half and difference angles, interpolated; sampled half by the cosine, half by a GGX lobe."""

        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            data = np.load(FOLDER / props["filename"])
            tables = data["table"]
            self.shape, n_tables = tables.shape[1:5], len(tables)
            self.table = mi.Float(tables.astype(np.float32).ravel())
            self.starts = [k * int(np.prod(self.shape)) for k in range(n_tables)]
            self.factors = [Factor(data, k) for k in range(n_tables)]
            self.alpha = float(data["alpha"])
            self.up, self.side = (mi.Vector3f(*map(float, axis)) for axis in data["axes"])
            self.turn_size, self.turns = data["turns"].shape[:2], mi.Float(data["turns"].astype(np.float32).ravel())
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [flags]
            self.m_flags = flags

        def frame(self, si):
            """The frame of the table, rotated to the surface's own Y axis and from there, on the side of the camera."""
            n = mi.Vector3f(si.sh_frame.n)
            n = dr.select(mi.Frame3f.cos_theta(si.wi) < 0, -n, n)
            across = dr.cross(self.up, n)
            t = dr.normalize(dr.select(dr.squared_norm(across) > 1e-8, across, dr.cross(dr.cross(n, self.side), n)))
            angle = self.turn(si.uv)
            t = dr.cos(angle) * t + dr.sin(angle) * dr.cross(n, t)
            return mi.Frame3f(t, dr.cross(n, t), n)

        def turn(self, uv):
            """The angle by which the tangent is rotated, from an image of (cos 2 angle, sin 2 angle), row 0 on top."""
            (height, width), twice = self.turn_size, mi.Vector2f(0)
            columns, rows = texels(uv.x, width), texels(1 - uv.y, height)
            for (column, across), (row, down) in ((a, b) for a in columns for b in rows):
                twice += across * down * dr.gather(mi.Vector2f, self.turns, row * width + column)
            return 0.5 * dr.atan2(twice.y, twice.x)

        def directions(self, si, wo):
            frame = self.frame(si)
            return frame, frame.to_local(si.to_world(si.wi)), frame.to_local(si.to_world(wo))

        def sample(self, ctx, si, sample1, sample2, active=True):
            frame, eye, _ = self.directions(si, si.wi)
            diffuse_sample = mi.warp.square_to_cosine_hemisphere(sample2)
            cosine = dr.sqrt((1 - sample2.x) / (1 + (self.alpha**2 - 1) * sample2.x))
            sine, phi = dr.safe_sqrt(1 - cosine * cosine), 2 * dr.pi * sample2.y
            half = mi.Vector3f(sine * dr.cos(phi), sine * dr.sin(phi), cosine)
            light = dr.select(sample1 < 0.5, diffuse_sample, 2 * dr.dot(eye, half) * half - eye)
            wo = si.to_local(frame.to_world(light))
            active = active & (eye.z > 0) & (light.z > 0)
            value, pdf = self.reflected(si, eye, light, active), self.density(eye, light)
            sample = dr.zeros(mi.BSDFSample3f)
            sample.wo, sample.pdf, sample.eta = wo, dr.select(active, pdf, 0), 1.0
            sample.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            sample.sampled_component = 0
            return sample, dr.select(active & (pdf > 0), value / pdf, 0)

        def eval(self, ctx, si, wo, active=True):
            _, eye, light = self.directions(si, wo)
            return self.reflected(si, eye, light, active)

        def pdf(self, ctx, si, wo, active=True):
            _, eye, light = self.directions(si, wo)
            return dr.select(active & (eye.z > 0) & (light.z > 0), self.density(eye, light), 0)

        def eval_pdf(self, ctx, si, wo, active=True):
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def density(self, eye, light):
            half = dr.normalize(eye + light)
            a2 = self.alpha**2
            ggx = a2 / (dr.pi * dr.square(1 + (a2 - 1) * half.z * half.z))
            lobe = ggx * half.z / (4 * dr.maximum(dr.dot(eye, half), 1e-6))
            return 0.5 * light.z / dr.pi + 0.5 * dr.select(half.z > 0, lobe, 0)

        def reflected(self, si, eye, light, active):
            """The tables, interpolated, each times its images, times the cosine of the light; `eye` is wo, `light`
            wi."""
            half = dr.normalize(eye + light)
            flat = dr.sqrt(half.x * half.x + half.y * half.y)
            theta_h, theta_d = dr.atan2(flat, half.z), dr.safe_acos(dr.dot(light, half))
            x, y = dr.select(flat > 1e-7, half.x / flat, 1), dr.select(flat > 1e-7, half.y / flat, 0)
            along = light.x * x * half.z + light.y * y * half.z - light.z * flat
            phi_d, phi_h = dr.atan2(light.y * x - light.x * y, along), dr.atan2(y, x)
            n_turns, n_h, n_d, n_p = self.shape
            places = [
                around(phi_h / (2 * dr.pi), n_turns), between(dr.sqrt(theta_h * 2 / dr.pi), n_h),
                between(theta_d * 2 / dr.pi, n_d), around(phi_d / (2 * dr.pi), n_p),
            ]  # fmt: skip
            active = active & (eye.z > 0) & (light.z > 0)
            value, factors = mi.Color3f(0), [factor.at(si, active) for factor in self.factors]
            for corner in range(16):
                index, weight = mi.UInt32(0), mi.Float(1)
                for axis, ((low, high), share) in enumerate(places):
                    upper = bool(corner >> axis & 1)
                    index = index * self.shape[axis] + (high if upper else low)
                    weight *= share if upper else 1 - share
                if n_turns > 1 or not corner & 1:
                    for start, factor in zip(self.starts, factors, strict=True):
                        value += weight * factor * dr.gather(mi.Color3f, self.table, start + index, active)
            return dr.select(active, dr.maximum(value, 0) * light.z, 0)

        def to_string(self):
            return f"Insitu[{self.shape}]"

    def between(share, n):
        """The grid points below and above a place on an axis, and its fraction between them. The ends are grid
        points."""
        position = dr.clip(share, 0, 1) * (n - 1)
        low = dr.minimum(mi.UInt32(position), max(n - 2, 0))
        return (low, dr.minimum(low + 1, n - 1)), position - mi.Float(low)

    def within(place, wrap):
        """A place on an axis that repeats (0), is mirrored (1) or extends its edge (2), in [0, 1]."""
        if wrap == 2:
            return dr.clip(place, 0, 1)
        if wrap == 1:
            return 1 - dr.abs(2 * (0.5 * place - dr.floor(0.5 * place)) - 1)
        return place - dr.floor(place)

    def texels(share, n, repeats=True):
        """The texels on either side of a place on an axis, and their weights."""
        if not repeats:
            position = dr.clip(share * n - 0.5, 0, n - 1)
            low = dr.minimum(mi.UInt32(position), max(n - 2, 0))
            fraction = position - mi.Float(low)
            return (low, 1 - fraction), (dr.minimum(low + 1, n - 1), fraction)
        (low, high), fraction = around(share - 0.5 / n, n)
        return (low, 1 - fraction), (high, fraction)

    def around(share, n):
        """The same of an axis that closes to a circle."""
        if n == 1:
            return (mi.UInt32(0), mi.UInt32(0)), mi.Float(0)
        position = (share - dr.floor(share)) * n
        low = mi.UInt32(position) % n
        return (low, (low + 1) % n), position - dr.floor(position)

    return Insitu


def main():
    parser = argparse.ArgumentParser(description="Render scene.xml with Mitsuba 3.")
    parser.add_argument("--output", type=Path, default=FOLDER / "render.exr")
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--size", type=int, nargs=2, metavar=("WIDTH", "HEIGHT"))
    wanted = parser.parse_args()
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(wanted.variant)
    made = insitu_bsdf(mi, dr)
    mi.register_bsdf("insitu", lambda props: made(props))
    scene = mi.load_file(str(FOLDER / "scene.xml"))
    if wanted.size:
        parameters = mi.traverse(scene)
        parameters[next(key for key in parameters.keys() if key.endswith("film.size"))] = wanted.size
        parameters.update()
    image = mi.render(scene, spp=wanted.samples)
    mi.Bitmap(np.array(image)).write(str(wanted.output))


if __name__ == "__main__":
    main()
