"""Rigged glTF files, remeshed by quadrig and by Blender's QuadriFlow at the same count: two tables in Markdown.

    python3 bench/gltf_figures.py [--quads N] QUADRIG FILE.glb...

Bending: both results stand for the input's largest surface, take its weights from the closest point, and are posed by the file's own
clips (`quadrig stats --poses clips`). Texture: the written file's own coordinates, against QuadriFlow's quads with the coordinates of
the closest point of the input. The distance is that between textured surfaces: points in space and, scaled by the diagonal, in the
texture together, from 40 000 places of the result to the nearest of the input; `smeared` is the share that is off by more than
2 % of the diagonal. QuadriFlow is asked for N quads, quadrig for as many as it made. Needs `blender`, numpy and scipy (Debian:
python3-numpy, python3-scipy)."""
import argparse
import base64
import json
import pathlib
import struct
import subprocess
import tempfile

import numpy as np
from scipy.spatial import cKDTree

from quadriflow import BLENDER, read

TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Gltf:
    """As much of a file as the figures need."""

    def __init__(self, path):
        raw, self.binary = path.read_bytes(), b""
        if raw[:4] == b"glTF":
            length = struct.unpack("<I", raw[12:16])[0]
            self.json, self.binary = json.loads(raw[20:20 + length]), raw[28 + length:]
        else:
            self.json = json.loads(raw)
        self.folder = path.parent

    def buffer(self, number):
        uri = self.json["buffers"][number].get("uri")
        if uri is None:
            return self.binary
        return base64.b64decode(uri.split(",", 1)[1]) if uri.startswith("data:") else (self.folder / uri).read_bytes()

    def values(self, number):
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, width = np.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
        raw = np.frombuffer(self.buffer(view["buffer"]), np.uint8)[view.get("byteOffset", 0) + accessor.get("byteOffset", 0):]
        row = kind.itemsize * width
        rows = np.lib.stride_tricks.as_strided(raw, (accessor["count"], row), (view.get("byteStride", row), 1))
        values = np.ascontiguousarray(rows).view(kind).reshape(-1, width).astype(float)
        if accessor.get("normalized"):
            values /= np.iinfo(kind).max
        return values

    def surface(self, skin):
        """Positions, texture coordinates (or None) and triangles of what the skin moves, a vertex a corner."""
        points, texture = [], []
        meshes = {node["mesh"] for node in self.json["nodes"] if node.get("skin") == skin and "mesh" in node}
        for mesh in sorted(meshes):
            for primitive in self.json["meshes"][mesh]["primitives"]:
                attributes = primitive["attributes"]
                if primitive.get("mode", 4) != 4 or "JOINTS_0" not in attributes:
                    continue
                corners = self.values(attributes["POSITION"])
                order = self.values(primitive["indices"])[:, 0].astype(int) if "indices" in primitive else np.arange(len(corners))
                points.append(corners[order])
                texture.append(self.values(attributes["TEXCOORD_0"])[order] if "TEXCOORD_0" in attributes else None)
        textured = all(part is not None for part in texture)
        return np.concatenate(points), np.concatenate(texture) if textured else None


def weld(points):
    """Vertices by their place, and the triangles that are left."""
    places, number = np.unique(points, axis=0, return_inverse=True)
    faces = number.reshape(-1, 3)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return places, faces[whole]


def samples(corners, count, random):
    """Points of triangles, a row of three corners each, spread by area in the first three numbers: points, triangles."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = np.linalg.norm(np.cross(b[:, :3] - a[:, :3], c[:, :3] - a[:, :3]), axis=1)
    chosen = random.choice(len(corners), count, p=area / area.sum())
    u, v = random.random((2, count))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return a[chosen] + u[:, None] * (b - a)[chosen] + v[:, None] * (c - a)[chosen], chosen


def nearest(points, corners):
    """Nearest points of triangles, one each, in any number of dimensions: their barycentric coordinates and distances."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = points - a
    dot = lambda x, y: (x * y).sum(1)
    d00, d01, d11, d20, d21 = dot(ab, ab), dot(ab, ac), dot(ac, ac), dot(p, ab), dot(p, ac)
    det = d00 * d11 - d01 * d01
    safe = np.where(det > 1e-14 * d00 * d11, det, 1)
    v, w = (d11 * d20 - d01 * d21) / safe, (d00 * d21 - d01 * d20) / safe
    inside = (det > 1e-14 * d00 * d11) & (v >= 0) & (w >= 0) & (v + w <= 1)
    bc = ac - ab
    s = np.clip(d20 / np.maximum(d00, 1e-300), 0, 1)
    t = np.clip(d21 / np.maximum(d11, 1e-300), 0, 1)
    r = np.clip(dot(p - ab, bc) / np.maximum(dot(bc, bc), 1e-300), 0, 1)
    best, place = np.full(len(p), np.inf), np.zeros((len(p), 2))
    for v, w, valid in ((v, w, inside), (s, 0 * s, True), (0 * t, t, True), (1 - r, r, True)):
        distance = np.where(valid, np.linalg.norm(p - v[:, None] * ab - w[:, None] * ac, axis=1), np.inf)
        place = np.where((distance < best)[:, None], np.stack([v, w], 1), place)
        best = np.minimum(best, distance)
    return place, best


class Surface:
    """Triangles that are asked for their nearest points."""

    def __init__(self, corners, random):
        self.corners = corners
        points, self.triangle = samples(corners, 400000, random)
        self.tree = cKDTree(points)

    def closest(self, points):
        """Triangle, barycentric coordinates and distance of the nearest point, looked for around the nearest samples."""
        _, near = self.tree.query(points, 6)
        best = np.full(len(points), np.inf)
        triangle, place = np.zeros(len(points), int), np.zeros((len(points), 2))
        for k in range(near.shape[1]):
            own = self.triangle[near[:, k]]
            found, distance = nearest(points, self.corners[own])
            better = distance < best
            triangle[better], place[better], best[better] = own[better], found[better], distance[better]
        return triangle, place, best


def texture_figures(space, textured, points, texture, random):
    corners = np.concatenate([points, texture * space], 1).reshape(-1, 3, 5)
    places, _ = samples(corners, 40000, random)
    distance = textured.closest(places)[2] / space
    return 1e4 * np.sqrt((distance ** 2).mean()), 1e4 * np.percentile(distance, 99), 100 * (distance > 0.02).mean()


def quadriflow(folder, places, faces, quads):
    (folder / "surface.json").write_text(json.dumps([places.tolist(), faces.tolist()]))
    (folder / "quadriflow.py").write_text(BLENDER)
    out = folder / "quadriflow.obj"
    subprocess.run(["blender", "-b", "--factory-startup", "--python", folder / "quadriflow.py", "--", folder / "surface.json", out,
                    str(quads)], capture_output=True)
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("quadrig")
    parser.add_argument("files", nargs="+", type=pathlib.Path)
    parser.add_argument("--quads", type=int, default=4000)
    parser.add_argument("--options", default="", help="for quadrig remesh")
    arguments = parser.parse_args()
    bending, textures = [], []
    for path in arguments.files:
        random = np.random.default_rng(7)
        file = Gltf(path)
        points, texture = file.surface(0)
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            peer = quadriflow(folder, *weld(points), arguments.quads)
            count = arguments.quads
            made = peer.exists() and read(peer)
            if made:
                made = None if any(len(face) != 4 for face in made[1]) else made
                count = len(made[1]) if made else count
            ours = folder / "quadrig.obj"
            subprocess.run([arguments.quadrig, "-q", "remesh", path, "--quads", str(count), "-o", folder / "out.glb", "--quads-out",
                            ours, *arguments.options.split()], check=True, capture_output=True)
            for title, mesh in (("QuadriFlow", peer if made else None), ("quadrig", ours)):
                if not mesh:
                    bending.append(f"| {path.name} | {title} | makes no quads | | | | |")
                    continue
                figures = subprocess.run([arguments.quadrig, "-q", "stats", mesh, "--json", "--input", path, "--poses", "clips"],
                                         capture_output=True, text=True).stdout
                if figures:
                    figures = json.loads(figures)["meshes"][0]
                    error, shape = figures["deformation"], figures["scaled_jacobian"]
                    bending.append(f"| {path.name} | {title} | {figures['quads']} | {figures['irregular_interior']} | "
                                   f"{shape['average']:.3f} / {shape['minimum']:.2f} | {error['joints']['rms']:.2f} | {error['all']['rms']:.2f} | "
                                   f"{error['all']['normal_degrees']:.1f} |")
            if texture is not None:
                space = np.linalg.norm(points.max(0) - points.min(0))
                textured = Surface(np.concatenate([points, texture * space], 1).reshape(-1, 3, 5), random)
                if made:
                    vertices, quads = np.array(made[0]), np.array(made[1])
                    triangle, place, _ = Surface(points.reshape(-1, 3, 3), random).closest(vertices)
                    own = texture.reshape(-1, 3, 2)[triangle]
                    carried = own[:, 0] + place[:, :1] * (own[:, 1] - own[:, 0]) + place[:, 1:] * (own[:, 2] - own[:, 0])
                    order = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1)
                    rows = [("QuadriFlow", len(quads), vertices[order], carried[order])]
                else:
                    rows = []
                rows.append(("quadrig", count, *Gltf(folder / "out.glb").surface(0)))
                for title, count, p, t in rows:
                    rms, most, smeared = texture_figures(space, textured, p, t, random)
                    textures.append(f"| {path.name} | {title} | {count} | {rms:.1f} | {most:.1f} | {smeared:.2f} % |")
        print(path.name, flush=True)
    print("\n| file | | quads | irregular | SJ avg / min | joints | all | normals |\n|---|---|---|---|---|---|---|---|\n" + "\n".join(bending))
    print("\n| file | | quads | rms | 99 % | smeared |\n|---|---|---|---|---|---|\n" + "\n".join(textures))


if __name__ == "__main__":
    main()
