#!/usr/bin/env python3
"""Remeshes plain solids and boxes at several counts and says which corners the quads miss.

A corner is missed where no point of the quads is nearer to it than an edge of a quad, the root of the solid's area over
the number of quads. Prints one row a solid and one line in all; ends with an error where a corner is missed and the
report has no warning of it, or where the command fails.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import time


def prism(polygon, height):
    """Triangles of a prism; caps are fans from the first corner, which suits convex polygons."""
    n = len(polygon)
    points = [(x, y, z) for z in (0, height) for x, y in polygon]
    faces = [(0, k + 1, k) for k in range(1, n - 1)] + [(n, n + k, n + k + 1) for k in range(1, n - 1)]
    for k in range(n):
        m = (k + 1) % n
        faces += [(k, m, n + m), (k, n + m, n + k)]
    return points, faces


def regular(n, radius=1.0, turn=0.0):
    return [(radius * math.cos(turn + 2 * math.pi * k / n), radius * math.sin(turn + 2 * math.pi * k / n))
            for k in range(n)]


def pyramid(n, radius, height):
    points = [(x, y, 0) for x, y in regular(n, radius)] + [(0, 0, height)]
    return points, [(0, k + 1, k) for k in range(1, n - 1)] + [(k, (k + 1) % n, n) for k in range(n)]


def hull(points):
    """Triangles of the convex hull of a few points, none of them inside."""
    faces = []
    for a in range(len(points)):
        for b in range(len(points)):
            for c in range(len(points)):
                if a < b and a < c and b != c:
                    normal = cross(minus(points[b], points[a]), minus(points[c], points[a]))
                    if all(dot(normal, minus(p, points[a])) < 1e-9 for p in points):
                        faces.append((a, b, c))
    return points, faces


def stairs(steps):
    """A block with steps: cells of a grid, their outer faces."""
    return cells({(x, 0, z) for x in range(steps) for z in range(x + 1)})


def cells(full):
    number, faces = {}, []

    def vertex(p):
        return number.setdefault(p, len(number))

    for x, y, z in sorted(full):
        for axis in range(3):
            for side in (0, 1):
                other = [x, y, z]
                other[axis] += 2 * side - 1
                if tuple(other) in full:
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                ring = []
                for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    p = [x, y, z]
                    p[axis] += side
                    p[u] += du
                    p[v] += dv
                    ring.append(vertex(tuple(p)))
                if not side:
                    ring.reverse()
                faces += [(ring[0], ring[1], ring[2]), (ring[0], ring[2], ring[3])]
    return [tuple(map(float, p)) for p in number], faces


def box(a, b, c):
    return prism([(0, 0), (a, 0), (a, b), (0, b)], c)


def screwdriver():
    """A grip of eight sides, a shaft of eight, and a blade that ends in an edge."""
    rings = [(0.0, 0.25, 0.25), (0.1, 0.5, 0.5), (2.0, 0.5, 0.5), (2.3, 0.12, 0.12), (5.2, 0.12, 0.12)]
    points, faces = [], []
    for z, a, b in rings:
        points += [(a * x, b * y, z) for x, y in regular(8, 1.0, math.pi / 8)]
    for r in range(len(rings) - 1):
        for k in range(8):
            i, j = 8 * r + k, 8 * r + (k + 1) % 8
            faces += [(i, j, j + 8), (i, j + 8, i + 8)]
    faces += [(0, k + 1, k) for k in range(1, 7)]
    top = 8 * (len(rings) - 1)
    points += [(0.2, 0.0, 6.0), (-0.2, 0.0, 6.0)]
    right, left = len(points) - 2, len(points) - 1
    for k in range(8):  # corners at 22.5 + 45 k degrees: the right tip to the four with x > 0
        i, j = top + k, top + (k + 1) % 8
        end = right if k in (6, 7, 0) else left if k in (2, 3, 4) else None
        if end is not None:
            faces.append((i, j, end))
        else:  # over the gap at 90 and 270 degrees
            first, second = (right, left) if k == 1 else (left, right)
            faces += [(i, j, second), (i, second, first)]
    return points, faces


GOLD = (1 + math.sqrt(5)) / 2


def solids():
    return {
        "cube": box(1, 1, 1),
        "board": box(2, 1.5, 0.06),
        "plank": box(4, 0.5, 0.1),
        "tetrahedron": hull([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]),
        "octahedron": hull([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]),
        "icosahedron": hull([(0, s, t * GOLD) for s in (-1, 1) for t in (-1, 1)] +
                            [(s, t * GOLD, 0) for s in (-1, 1) for t in (-1, 1)] +
                            [(t * GOLD, 0, s) for s in (-1, 1) for t in (-1, 1)]),
        "pyramid_tall": pyramid(4, 0.5, 4),
        "cone": pyramid(24, 1, 2),
        "disc": prism(regular(32), 0.05),
        "wedge": prism([(0, 0), (2, 0), (2, 0.5)], 1),
        "prism_3": prism(regular(3), 2),
        "prism_6": prism(regular(6), 0.4),
        "stairs": stairs(3),
        "screwdriver": screwdriver(),
    }


def boxes():
    sides = [(1, 1, .5), (1, 1, .2), (1, 1, .1), (1, 1, .05), (1, 1, 2), (1, 1, 5), (1, 1, 10), (1, 1, 20),
             (1, .5, .25), (1, .5, .1), (1, .3, .02), (2, 1, .5), (3, 2, 1), (10, 2, .2)]
    return {"box_" + "_".join(f"{s:g}" for s in side): box(*side) for side in sides}


def minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def length(a):
    return math.sqrt(dot(a, a))


def from_triangle(p, a, b, c):
    """Distance of a point from a triangle (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ab, ac, ap = minus(b, a), minus(c, a), minus(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0 and d2 <= 0:
        return length(ap)
    bp = minus(p, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0 and d4 <= d3:
        return length(bp)
    cp = minus(p, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0 and d5 <= d6:
        return length(cp)

    def off(u, v):
        return length(tuple(ap[i] - u * ab[i] - v * ac[i] for i in range(3)))

    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    if vc <= 0 <= d1 and d3 <= 0:
        return off(d1 / (d1 - d3), 0)
    if vb <= 0 <= d2 and d6 <= 0:
        return off(0, d2 / (d2 - d6))
    if va <= 0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return off(1 - w, w)
    total = va + vb + vc
    return off(vb / total, vc / total)


def read_obj(path):
    points, faces = [], []
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append(tuple(map(float, words[1:4])))
        elif words[:1] == ["f"]:
            faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
    return points, faces


def corners(points, faces, sharp_degrees=20):
    """Vertices at which at least three edges bend more than this, or that are tips: the area around them is missing."""
    normals = {}
    for f in faces:
        a, b, c = (points[v] for v in f)
        n = cross(minus(b, a), minus(c, a))
        normals[f] = tuple(x / length(n) for x in n)
    across = {}
    for f in faces:
        for i in range(3):
            across[(f[i], f[(i + 1) % 3])] = f
    bends, angle = [0] * len(points), [0.0] * len(points)
    for (v, w), f in across.items():
        bends[v] += dot(normals[f], normals[across[(w, v)]]) < math.cos(math.radians(sharp_degrees))
    for f in faces:
        for i in range(3):
            u = minus(points[f[(i + 1) % 3]], points[f[i]])
            w = minus(points[f[(i + 2) % 3]], points[f[i]])
            angle[f[i]] += math.acos(max(-1.0, min(1.0, dot(u, w) / length(u) / length(w))))
    return [v for v in range(len(points)) if bends[v] >= 3 or angle[v] < 1.5 * math.pi]


def area(points, faces):
    return sum(length(cross(minus(points[b], points[a]), minus(points[c], points[a]))) / 2 for a, b, c in faces)


def misses(points, faces, quads_path):
    """How far each corner is from the quads, in edges of theirs; and in diagonals of the solid."""
    quad_points, quads = read_obj(quads_path)
    edge = math.sqrt(area(points, faces) / len(quads))
    low, high = ([pick(p[i] for p in points) for i in range(3)] for pick in (min, max))
    diagonal = length(minus(high, low))
    triangles = [(q[0], q[k], q[k + 1]) for q in quads for k in (1, 2)]
    worst_edges = worst_diagonals = 0.0
    for v in corners(points, faces):
        off = min(from_triangle(points[v], *(quad_points[c] for c in t)) for t in triangles)
        worst_edges, worst_diagonals = max(worst_edges, off / edge), max(worst_diagonals, off / diagonal)
    return worst_edges, worst_diagonals


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", help="the quadrig executable")
    parser.add_argument("--boxes", action="store_true", help="boxes in place of solids")
    parser.add_argument("--only", default="", help="solids whose name contains this")
    parser.add_argument("--quads", default="30,50,80,116,150,200,300,500,900,2000", help="counts (default %(default)s)")
    parser.add_argument("--edges", type=float, default=1.0, help="a corner farther than this many edges is missed")
    parser.add_argument("--write", type=pathlib.Path, help="write the solids to this folder, and stop")
    parser.add_argument("options", nargs="*", help="more options of `quadrig remesh`, after --")
    arguments = parser.parse_args()
    shapes = {name: shape for name, shape in (boxes() if arguments.boxes else solids()).items()
              if arguments.only in name}
    if not shapes:
        sys.exit(f"no solid has {arguments.only} in its name")
    tried = missed = missed_diagonal = silent = failed = 0
    total_seconds = 0.0
    print("| solid | corners missed at | farthest, edges | of which without a warning | seconds | SJ min |")
    print("|---|---|---|---|---|---|")
    for name, (points, faces) in shapes.items():
        with tempfile.TemporaryDirectory() as scratch:
            folder = arguments.write or pathlib.Path(scratch)
            folder.mkdir(parents=True, exist_ok=True)
            solid = folder / (name + ".obj")
            solid.write_text("".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points) +
                             "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces))
            if arguments.write:
                continue
            missed_at, silent_at, farthest, least, began = [], [], 0.0, 1.0, time.monotonic()
            for quads in arguments.quads.split(","):
                out, report = pathlib.Path(scratch) / "out.obj", pathlib.Path(scratch) / "report.json"
                done = subprocess.run([arguments.command, "remesh", solid, "--quads", quads, "-o", out, "--report",
                                       report, "--quiet", *arguments.options], capture_output=True, text=True)
                tried += 1
                if not out.exists():
                    failed += 1
                    missed_at.append(f"{quads}: {done.stderr.strip()}")
                    continue
                figures = json.loads(report.read_text())
                edges, diagonals = misses(points, faces, out)
                farthest, least = max(farthest, edges), min(least, figures["scaled_jacobian"]["minimum"])
                missed_diagonal += diagonals > 0.05
                if edges > arguments.edges:
                    missed += 1
                    missed_at.append(quads)
                    if not any(warning.startswith("coverage: ") for warning in figures["warnings"]):
                        silent += 1
                        silent_at.append(quads)
                out.unlink()
            seconds = time.monotonic() - began
            total_seconds += seconds
            print(f"| {name} | {' '.join(missed_at)} | {farthest:.2f} | {' '.join(silent_at)} | {seconds:.1f} | "
                  f"{least:.2f} |", flush=True)
    print(f"{tried} tried, {missed} missed a corner by more than {arguments.edges:g} edges, {silent} of them without a "
          f"warning; {missed_diagonal} by more than 5 % of the diagonal; {failed} failed; {total_seconds:.0f} s")
    sys.exit(1 if silent or failed else 0)


if __name__ == "__main__":
    main()
