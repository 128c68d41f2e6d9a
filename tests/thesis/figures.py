#!/usr/bin/env python3
"""Figures 4.1 to 5.17 of the thesis and a table of what was measured: figures.py QUADRIG PICTURE FOLDER [--only NAME]…

Reads the project's samples, and from QUADRIG_CORPUS, where it is set, bunny and fandisk (figures 5.13 and 5.14).
QUADRIFLOW and INSTANT_MESHES name the programs that figure 5.15 stands beside. Writes FOLDER/*.png, table.md and
table.json; the posed error is in 1e-4 of the diagonal, joints / all.
"""
import argparse
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import time

BENDS = [("6", "z", 40), ("7", "z", -35), ("14", "z", -40), ("15", "x", -60), ("10", "x", -75), ("11", "x", 80), ("18", "x", 15)]
SIZE = {"--width": "300", "--height": "420"}


def tgf(path):
    joints, bones, part = {}, [], 0
    for line in path.read_text().split("\n"):
        words = line.split()
        if words and words[0] == "#":
            part += 1
        elif words and part == 0:
            joints[int(words[0])] = [float(w) for w in words[1:4]]
        elif words and part == 1:
            bones.append((int(words[0]), int(words[1])))
    return joints, bones


def write_tgf(path, joints, bones):
    lines = [f"{n} {p[0]!r} {p[1]!r} {p[2]!r}" for n, p in joints.items()]
    path.write_text("\n".join(lines + ["#"] + [f"{a} {b}" for a, b in bones] + ["#"]) + "\n")


def dmat(path):
    numbers = path.read_text().split()
    columns, rows = int(numbers[0]), int(numbers[1])
    values = [float(x) for x in numbers[2:]]
    return [[values[c * rows + r] for c in range(columns)] for r in range(rows)]


def obj(path):
    points, faces = [], []
    for line in path.read_text().split("\n"):
        words = line.split()
        if words and words[0] == "v":
            points.append([float(w) for w in words[1:4]])
        elif words and words[0] == "f":
            faces.append([int(w.split("/")[0]) - 1 for w in words[1:]])
    return points, faces


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def area(points, face):
    o = points[face[0]]
    total = [0.0, 0.0, 0.0]
    for i in range(1, len(face) - 1):
        n = cross([points[face[i]][k] - o[k] for k in range(3)], [points[face[i + 1]][k] - o[k] for k in range(3)])
        total = [t + x / 2 for t, x in zip(total, n)]
    return math.sqrt(sum(x * x for x in total))


def joint_density(mesh, weights, density=None):
    """Quads a unit area where two bones rule (omega2 > .8) over where one does (omega1 > .9); `density` of each face:
    the field's own, else one quad a face."""
    points, faces = mesh
    count, areas = [0.0, 0.0], [0.0, 0.0]
    for f, face in enumerate(faces):
        mean = sorted((sum(weights[v][b] for v in face) / len(face) for b in range(len(weights[0]))), reverse=True) + [0, 0]
        one, two = mean[0] - mean[1], 2 * (mean[1] - mean[2])
        kind = 0 if one > 0.9 else 1 if two > 0.8 else None
        if kind is not None:
            size = area(points, face)
            count[kind] += density[f] * size if density else 1
            areas[kind] += size
    return count[1] / areas[1] / (count[0] / areas[0]) if min(areas) > 0 and count[0] > 0 else None


def joint_distance(singular, files):
    """Mean distance from a singular vertex to the nearest joint, as a share of the surface's diagonal."""
    points, joints = obj(files[0])[0] if files[0].suffix == ".obj" else [], tgf(files[1])[0].values()
    if not points or not singular:
        return None
    diagonal = math.dist(*[[limit(p[k] for p in points) for k in range(3)] for limit in (min, max)])
    return sum(min(math.dist(v["place"], j) for j in joints) for v in singular) / len(singular) / diagonal


class Figures:
    def __init__(self, quadrig, picture, folder):
        self.quadrig, self.picture_command, self.folder = quadrig, picture, folder
        self.rows, self.done = [], {}
        folder.mkdir(parents=True, exist_ok=True)
        self.work = folder / "work"
        self.work.mkdir(exist_ok=True)

    def run(self, *words):
        result = subprocess.run([self.quadrig, *map(str, words)], capture_output=True, text=True)
        if result.returncode not in (0, 9):
            raise RuntimeError(" ".join(map(str, words)) + ": " + result.stderr.strip())
        return result.stdout

    def picture(self, name, *words):
        size = [w for option, pixels in SIZE.items() if option not in words for w in (option, pixels)]
        subprocess.run([self.picture_command, *map(str, words), *size, "-o", self.folder / (name + ".png")], check=True)

    def sample(self, name, triangles=20000):
        key = f"{name}-{triangles}"
        if key not in self.done:
            out = self.work / key
            out.mkdir(exist_ok=True)
            self.run("sample", name, "--triangles", triangles, "-o", out)
            self.done[key] = (out / f"{name}.obj", out / f"{name}.tgf", out / f"{name}.dmat")
        return self.done[key]

    def rigged(self, files):
        return [] if files[1] is None else ["--rig", files[1], "--weights", files[2]]

    def bound(self, mesh, rig, method, name):
        out = self.work / f"{name}-{method}.dmat"
        if not out.exists():
            self.run("bind", mesh, "--rig", rig, "--method", method, "-o", out)
        return mesh, rig, out

    def field(self, files, preset, name, *options):
        report = self.work / f"{name}-{preset}-field.json"
        raw = self.work / f"{name}-{preset}.rawfield"
        self.run("field", files[0], *self.rigged(files), "--preset", preset, "--report", report, "-o", raw, *options)
        return json.loads(report.read_text()), raw

    def measured(self, figure, what, files, preset, quads, *options, remesh=True):
        """One row of the table, and the files of the quads."""
        again = (files, preset, quads, options)
        if again in self.done:
            row, out = self.done[again]
            self.rows.append({**row, "figure": figure, "what": what})
            return out
        stem = self.work / f"{figure}-{what}-{preset}".replace(" ", "_").replace(",", "")
        report, raw = self.field(files, preset, stem.name, *options)
        row = {"figure": figure, "what": what, "preset": preset, "triangles": report["faces"],
               "singularities": report["singularities_plus"] + report["singularities_minus"], "index_sum": report["index_sum"] / 4,
               "singular_to_joint": joint_distance(report["singular_vertices"], files) if files[1] else None,
               "degrees_to_bone_field": report["mean_angle_to_bone_deg"] if files[1] else None}
        weights = dmat(files[2]) if files[1] and report["faces"] < 100000 else None
        if weights:
            density = []
            for line in raw.read_text().split("\n")[1:]:
                v = [float(x) for x in line.split()]
                if v:
                    density.append(math.hypot(*v[0:3]) * math.hypot(*v[3:6]))
            row["joint_density_field"] = joint_density(obj(files[0]), weights, density)
        raw.unlink()
        out = (pathlib.Path(str(stem) + ".obj"), pathlib.Path(str(stem) + ".dmat"), pathlib.Path(str(stem) + "-map.obj"))
        if remesh:
            made = pathlib.Path(str(stem) + ".json")
            self.run("remesh", files[0], *self.rigged(files), "--preset", preset, "--quads", quads, "-o", out[0], "--map-out", out[2],
                     *(["--weights-out", out[1]] if files[1] else []), "--report", made, *options)
            row["rung"] = ", ".join(sorted({c["rung"] for c in json.loads(made.read_text())["components"]}))
            self.judge(row, files, out[0], own=True)
            if files[1]:
                row["joint_density_quads"] = joint_density(obj(out[0]), dmat(out[1]))
        self.rows.append(row)
        if remesh:
            self.done[again] = (row, out)
        return out

    def judge(self, row, files, quads, own):
        words = ["--input", files[0], *self.rigged(files), "--samples", "10000"]
        words += ["--own-weights"] if own and files[1] else []
        figures = json.loads(self.run("stats", quads, *words, "--json"))["meshes"][0]
        row.update(quads=figures["quads"], irregular=figures["irregular_interior"],
                   jacobian_average=figures["scaled_jacobian"]["average"], jacobian_least=figures["scaled_jacobian"]["minimum"])
        if files[1]:
            row["degrees_to_bone_quads"] = figures["guidance"]["bone_angle_mean_degrees"]
            row["posed_joints"], row["posed_all"] = (figures["deformation"][k]["rms"] for k in ("joints", "all"))
        else:
            row["rest_error"] = 1e4 * figures["distance"]["rms"]

    def posed(self, mesh, rig, weights, name, bends=BENDS):
        out = self.work / f"{name}-posed.obj"
        words = [w for bone, axis, angle in bends for w in ("--bone", f"bone{bone}", "--axis", axis, "--angle", angle)]
        self.run("pose", mesh, "--rig", rig, "--weights", weights, *words, "-o", out)
        return out


def dominance_4_1(f):
    panels = []
    for name in ("humanoid", "pear", "box_torus"):
        mesh, rig, weights = f.sample(name)
        for k in (1, 2, 3):
            panels += [mesh, f"rig={rig}", f"weights={weights}", f"colour=omega{k}", f"caption={name}: ω{k}",
                       "edges=no", f"legend={'ω' if k == 3 else 'no'}"]
    f.picture("4.1-dominance", *panels, "--own-frames", "--columns", "3", "--width", "260", "--height", "260", "--turn", "15", "--tilt", "25")


def projection_4_2(f):
    mesh, rig, weights = f.sample("humanoid")
    f.picture("4.2-projection", f"rig={rig}", f"weights={weights}", "edges=no", "bones=yes", mesh, "field=thesis", "spacing=0.005",
              "near=-0.11,0.68,0.014", "radius=0.06", "caption=one bone rules: along it", mesh, "field=thesis", "spacing=0.005",
              "near=bone11", "radius=0.06", "caption=two bones: denser across the joint", "--width", "400")


def process_5_1(f):
    files = mesh, rig, weights = f.sample("humanoid")
    quads, quad_weights, grid = f.measured("5.1", "humanoid", files, "thesis", 4000)
    f.measured("5.1", "humanoid", files, "default", 4000)
    f.picture("5.1-process", mesh, "caption=1 triangles", mesh, f"rig={rig}", "bones=yes", "edges=no", "caption=2 rig", mesh,
              f"rig={rig}", f"weights={weights}", "colour=bones", "edges=no", "caption=3 weights", mesh, f"rig={rig}",
              f"weights={weights}", "field=thesis", "edges=no", "caption=4 field", grid, "grid=yes", "caption=5 map", quads,
              "caption=6 quads", "--columns", "3")
    f.picture("5.2-deformations", f.posed(quads, rig, quad_weights, "5.2a"), "caption=posed", "dots=no",
              f.posed(quads, rig, quad_weights, "5.2b", [("2", "y", 25), ("6", "z", -35), ("14", "x", 60), ("10", "x", 20), ("18", "x", -25)]),
              "caption=and otherwise", "dots=no", "--width", "380")


def trivial_5_3(f):
    panels, rigs = [], []
    for name in ("pear", "box_torus"):
        files = mesh, rig, weights = f.sample(name)
        _, _, grid = f.measured("5.4", name, files, "thesis", 1500)
        f.measured("5.4", name, files, "default", 1500)
        rigs += [mesh, f"rig={rig}", f"weights={weights}", "colour=bones", "bones=yes", "edges=no", f"caption={name}: rig and weights"]
        panels += [mesh, f"rig={rig}", f"weights={weights}", "field=thesis", "edges=no", f"caption={name}: field",
                   grid, "grid=checker", "caption=its map"]
    f.picture("5.3-trivial-rigs", *rigs, "--own-frames", "--tilt", "30", "--width", "360", "--height", "360")
    f.picture("5.4-trivial-fields", *panels, "--own-frames", "--tilt", "30", "--columns", "2", "--width", "380", "--height", "360")


def wing_5_5(f):
    files = mesh, rig, weights = f.sample("wing")
    quads, quad_weights, grid = f.measured("5.5", "wing", files, "thesis", 2000)
    f.measured("5.5", "wing", files, "default", 2000)
    bent = f.posed(quads, rig, quad_weights, "5.5", [("1", "z", 8), ("2", "z", 16), ("3", "z", 24)])
    f.picture("5.5-wing", mesh, f"rig={rig}", "bones=yes", "edges=no", "caption=bones side by side", grid, "grid=yes",
              "caption=map: dense in the folds", bent, "dots=no", "caption=bent", "--own-frames", "--tilt", "60", "--height", "340")


def legs_5_6(f):
    files = f.sample("humanoid")
    quads, _, grid = f.measured("5.6", "humanoid", files, "thesis", 4000)
    f.picture("5.6-joints", f"rig={files[1]}", grid, "grid=yes", "near=bone11", "radius=0.13", "caption=knee: map", quads, "near=bone11",
              "radius=0.13", "caption=knee: quads", quads, "near=bone7", "radius=0.1", "caption=elbow: quads")


def weights_5_7(f):
    mesh, rig, _ = f.sample("humanoid")
    colours, fields, grids = [], [], []
    for method, says in (("biharmonic", "bounded biharmonic"), ("voxel", "geodesic voxels"), ("nearest", "piecewise constant")):
        files = f.bound(mesh, rig, method, "humanoid")
        _, _, grid = f.measured("5.8", says, files, "thesis", 4000)
        f.measured("5.8", says, files, "default", 4000)
        near = ["near=-0.115,0.5,0.01", "radius=0.3"]
        colours += [mesh, f"rig={rig}", f"weights={files[2]}", "colour=bones", "bones=yes", "edges=no", f"caption={says}"]
        fields += [mesh, f"rig={rig}", f"weights={files[2]}", "field=thesis", "edges=no", *near, f"caption={says}: field"]
        grids += [grid, "grid=yes", *near, f"caption={says}: map"]
    f.picture("5.7-weights", *colours)
    f.picture("5.8-weights-fields", *fields, *grids, "--columns", "3", "--height", "340")


def rigs_5_9(f):
    mesh, rig, _ = f.sample("humanoid")
    joints, bones = tgf(rig)
    few = f.work / "few.tgf"
    keep = [(1, 4), (4, 6), (7, 10), (11, 13), (15, 18), (19, 21), (4, 7), (1, 11), (4, 15), (1, 19)]
    write_tgf(few, joints, keep)
    bad = f.work / "bad.tgf"
    chance = random.Random(5)
    moved = {n: [x + chance.uniform(-0.06, 0.06) for x in p] for n, p in joints.items()}
    write_tgf(bad, moved, bones)
    panels = {}
    for name, tree in (("few bones", few), ("more bones", rig), ("bad placement", bad)):
        files = f.bound(mesh, tree, "voxel", name.replace(" ", "-"))
        figure = "5.10" if name.startswith("bad") else "5.9"
        _, _, grid = f.measured(figure, name, files, "thesis", 4000)
        f.measured(figure, name, files, "default", 4000)
        panels[name] = [mesh, f"rig={tree}", "bones=yes", "edges=no", f"caption={name}", grid, "grid=yes", "caption=map"]
    f.picture("5.9-rig-resolution", *panels["few bones"], *panels["more bones"])
    f.picture("5.10-rig-placement", *panels["bad placement"], *panels["more bones"])


def rest_5_11(f):
    files = mesh, rig, weights = f.sample("humanoid")
    raised = f.posed(mesh, rig, weights, "5.11-rest", [("6", "z", 40), ("14", "z", -40)])
    joints, bones = tgf(rig)
    for start, angle in ((7, 40), (15, -40)):
        pivot, radians = joints[start], math.radians(angle)
        for n in range(start + 1, start + 4):
            x, y = joints[n][0] - pivot[0], joints[n][1] - pivot[1]
            joints[n] = [pivot[0] + x * math.cos(radians) - y * math.sin(radians), pivot[1] + x * math.sin(radians) + y * math.cos(radians), joints[n][2]]
    posed_rig = f.work / "raised.tgf"
    write_tgf(posed_rig, joints, bones)
    good = (raised, posed_rig, weights)
    quads, quad_weights, _ = f.measured("5.11", "arms raised to the side", good, "thesis", 4000)
    f.measured("5.11", "arms raised to the side", good, "default", 4000)
    low, _, _ = f.measured("5.11", "arms half lowered", files, "thesis", 4000)
    f.measured("5.11", "arms half lowered", files, "default", 4000)
    back = f.posed(quads, posed_rig, quad_weights, "5.11-back", [("6", "z", -40), ("14", "z", 40)])
    near = ["near=0.2,1.38,0", "radius=0.2", "dots=no"]
    f.picture("5.11-rest-pose", quads, "dots=no", "caption=quads of raised arms", back, *near, "caption=then lowered", low, *near,
              "caption=quads of lowered arms")


def resolution_5_12(f):
    panels = []
    for triangles in (5000, 20000, 80000, 320000):
        files = f.sample("humanoid", triangles)
        for preset in ("thesis", "default"):
            quads, _, _ = f.measured("5.12", f"{triangles} triangles", files, preset, 4000, remesh=triangles <= 80000)
            if preset == "thesis" and triangles <= 80000:
                panels += [quads, f"caption={triangles // 1000}k triangles"]
    f.picture("5.12-resolution", *panels)


def unsuitable_5_13(f):
    corpus = os.environ.get("QUADRIG_CORPUS")
    if not corpus or not (pathlib.Path(corpus) / "surfaces").is_dir():
        print("5.13, 5.14: no QUADRIG_CORPUS, left out", file=sys.stderr)
        return
    for figure, name in (("5.13", "bunny"), ("5.14", "fandisk")):
        source = pathlib.Path(corpus) / "surfaces" / f"{name}.off"
        numbers = source.read_text().split()[1:]
        n = int(numbers[0])
        points = [[float(x) for x in numbers[3 + 3 * i:6 + 3 * i]] for i in range(n)]
        low, high = [min(p[k] for p in points) for k in range(3)], [max(p[k] for p in points) for k in range(3)]
        at = lambda t: [low[k] + t * (high[k] - low[k]) if k == 1 else (low[k] + high[k]) / 2 for k in range(3)]
        rig = f.work / f"{name}.tgf"
        write_tgf(rig, {i + 1: at(t) for i, t in enumerate((0.1, 0.5, 0.9))}, [(1, 2), (2, 3)])
        files = f.bound(source, rig, "voxel", name)
        _, _, grid = f.measured(figure, name, files, "thesis", 3000)
        quads, _, _ = f.measured(figure, name, files, "default", 3000)
        panels = [source, f"rig={rig}", "bones=yes", "edges=no", f"caption={name} and a rig", grid, "grid=yes", "caption=thesis", quads,
                  "caption=default"]
        if figure == "5.14":
            kept, _, _ = f.measured(figure, "fandisk with creases", (source, None, None), "static", 3000, "--creases", "40")
            panels += [kept, "caption=static, creases kept"]
        f.picture(f"{figure}-{name}", *panels, "--turn", "20", "--height", "340")


def static_5_15(f):
    files = mesh, _, _ = f.sample("humanoid")
    ours, _, _ = f.measured("5.15", "with the rig", files, "default", 4000)
    count = f.rows[-1]["quads"]
    stem = f.work / "5.15-static.obj"
    f.run("remesh", mesh, "--preset", "static", "--quads", count, "-o", stem)
    meshes = [("with the rig, weights of the closest points", ours), ("without the rig", stem)]
    for variable, words in (("QUADRIFLOW", lambda out: ["-i", mesh, "-o", out, "-f", count]),
                            ("INSTANT_MESHES", lambda out: [mesh, "-o", out, "-f", count, "-d"])):
        if os.environ.get(variable):
            out = f.work / f"5.15-{variable}.obj"
            subprocess.run([os.environ[variable], *map(str, words(out))], check=True, capture_output=True)
            meshes.append((variable.replace("_", " ").title(), out))
    for name, quads in meshes:
        # All by the surface's weights at the closest points: the own ones keep four influences, which would be held against the rig alone.
        row = {"figure": "5.15", "what": name, "preset": "default" if quads == ours else "static"}
        f.judge(row, files, quads, own=False)
        f.rows.append(row)
    panels = [w for name, quads in meshes for w in (quads, f"caption={name.split(',')[0]}")]
    f.picture("5.15-static", *panels, "--width", "360")


def jacobians_5_16(f):
    files = mesh, rig, weights = f.sample("humanoid")
    panels = []
    for preset in ("thesis", "default"):
        out, own, _ = f.measured("5.16", "at rest", files, preset, 4000)
        posed = f.posed(out, rig, own, f"5.17-{preset}")
        figures = json.loads(f.run("stats", posed, "--json"))["meshes"][0]["scaled_jacobian"]
        f.rows.append({"figure": "5.17", "what": "posed", "preset": preset, "jacobian_average": figures["average"],
                       "jacobian_least": figures["minimum"]})
        for name, quads in (("at rest", out), ("posed", posed)):
            panels += [quads, "colour=jacobian", "range=0,1", "legend=scaled Jacobian", "dots=no", f"caption={preset}, {name}"]
    f.picture("5.16-5.17-jacobians", *panels, "--columns", "2", "--width", "380")


FIGURES = [dominance_4_1, projection_4_2, process_5_1, trivial_5_3, wing_5_5, legs_5_6, weights_5_7, rigs_5_9, rest_5_11,
           resolution_5_12, unsuitable_5_13, static_5_15, jacobians_5_16]
COLUMNS = [("singularities", "singular", 0), ("index_sum", "index sum", 0), ("singular_to_joint", "singular to joint", 3),
           ("degrees_to_bone_field", "field to bone °", 1), ("joint_density_field", "joints/limbs, field", 2),
           ("joint_density_quads", "joints/limbs, quads", 2), ("quads", "quads", 0), ("irregular", "irregular", 0),
           ("degrees_to_bone_quads", "edges to bone °", 1), ("jacobian_average", "SJ average", 3), ("jacobian_least", "SJ least", 3),
           ("posed_joints", "posed, joints", 2), ("posed_all", "posed, all", 2), ("rest_error", "rest", 2)]


def write_table(folder, rows):
    """Rows of figures that were not made this time stay."""
    table = folder / "table.json"
    made = {row["figure"] for row in rows}
    if table.exists():
        rows = list(rows) + [row for row in json.loads(table.read_text()) if row["figure"] not in made]
    rows = sorted(rows, key=lambda row: [int(part) for part in row["figure"].split(".")])
    lines = ["| figure | what | preset | " + " | ".join(title for _, title, _ in COLUMNS) + " |", "|" + "---|" * (3 + len(COLUMNS))]
    for row in rows:
        cells = ["" if row.get(key) is None else f"{row[key]:.{digits}f}" for key, _, digits in COLUMNS]
        lines.append(f"| {row['figure']} | {row['what']} | {row['preset']} | " + " | ".join(cells) + " |")
    (folder / "table.md").write_text("\n".join(lines) + "\n")
    table.write_text(json.dumps(rows, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("quadrig")
    parser.add_argument("picture")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--only", action="append", default=[])
    options = parser.parse_args()
    figures, failed = Figures(options.quadrig, options.picture, options.folder), 0
    for make in FIGURES:
        if options.only and not any(name in make.__name__ for name in options.only):
            continue
        start = time.monotonic()
        try:
            make(figures)
        except (RuntimeError, OSError, subprocess.CalledProcessError) as error:
            failed += 1
            print(f"{make.__name__}: {error}", file=sys.stderr)
        write_table(options.folder, figures.rows)
        print(f"{make.__name__}: {time.monotonic() - start:.1f} s", file=sys.stderr)
    print(f"{len(list(options.folder.glob('*.png')))} pictures, {failed} failed; the table is {options.folder / 'table.md'}")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
