"""Quads at rest beside a simplifier's triangles at the same number: a table in Markdown.

    python3 bench/simplifier.py QUADRIG --peer 'COMMAND {input} {output} {triangles}' [--quads N,N...] [--keep FOLDER] SURFACE...

The peer reads and writes OBJ and makes `triangles` triangles of the input: meshoptimizer's simplifier by whatever calls it.
Surfaces may be of any kind that quadrig reads as quads or triangles; counts of more than half of their triangles are left out.
Distances are root mean square there and back by `quadrig stats`, in 1e-4 of the diagonal; the ratio is quadrig's over the peer's."""
import argparse
import json
import math
import pathlib
import shlex
import statistics
import subprocess
import tempfile


def read(path):
    positions, faces = [], []
    if path.suffix == ".off":
        words = [word for line in path.read_text().splitlines() for word in line.split("#")[0].split()]
        vertices, polygons = int(words[1]), int(words[2])
        numbers = list(map(float, words[4:4 + 3 * vertices]))
        positions = [numbers[3 * i:3 * i + 3] for i in range(vertices)]
        at = 4 + 3 * vertices
        for _ in range(polygons):
            faces.append([int(word) + 1 for word in words[at + 1:at + 1 + int(words[at])]])
            at += 1 + int(words[at])
        return positions, faces
    for line in path.read_text(errors="replace").splitlines():
        if line.startswith("v "):
            positions.append(list(map(float, line.split()[1:4])))
        elif line.startswith("f "):
            corners = [int(corner.split("/")[0]) for corner in line.split()[1:]]
            faces.append([corner if corner > 0 else len(positions) + 1 + corner for corner in corners])
    return positions, faces


def write(path, positions, faces):
    """Triangles of the faces, without vertices that none has."""
    triangles = [[face[0], face[k], face[k + 1]] for face in faces for k in range(1, len(face) - 1)]
    number = {v: k + 1 for k, v in enumerate(sorted({v for t in triangles for v in t}))}
    with open(path, "w") as file:
        for v in number:
            file.write("v %.17g %.17g %.17g\n" % tuple(positions[v - 1]))
        for triangle in triangles:
            file.write("f %d %d %d\n" % tuple(number[v] for v in triangle))
    return len(triangles)


def figures(quadrig, mesh, surface):
    stats = [quadrig, "stats", mesh, "--json", "--input", surface]
    made = subprocess.run(stats, capture_output=True, text=True)
    found = json.loads(made.stdout)["meshes"][0]
    distance = found["distance"]
    return math.sqrt((distance["rms"] ** 2 + distance["back_rms"] ** 2) / 2) * 1e4, distance["hausdorff"] * 1e4, found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("quadrig")
    parser.add_argument("surfaces", nargs="+", type=pathlib.Path)
    parser.add_argument("--peer", required=True)
    parser.add_argument("--quads", default="500,1000,4000")
    parser.add_argument("--keep", type=pathlib.Path, help="where what was made stays; the peer's is taken from there where it is")
    arguments = parser.parse_args()
    print("| surface | quads | SJ avg / min | quadrig | simplifier | ratio | farthest, of an edge |")
    print("|---|---|---|---|---|---|---|")
    ratios, far = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = arguments.keep or pathlib.Path(name)
        folder.mkdir(exist_ok=True)
        for path in arguments.surfaces:
            surface = folder / (path.stem + ".obj")
            triangles = write(surface, *read(path))
            for quads in map(int, arguments.quads.split(",")):
                if 2 * quads > triangles / 2:
                    continue
                ours, report = folder / f"{path.stem}-{quads}.obj", folder / f"{path.stem}-{quads}.json"
                made = subprocess.run([arguments.quadrig, "remesh", surface, "--quads", str(quads), "-o", ours, "--report", report],
                                      capture_output=True, text=True)
                if made.returncode:
                    print(f"| {path.stem} {quads} | failed: {made.stderr.strip().splitlines()[-1]} | | | | | |", flush=True)
                    continue
                error, farthest, found = figures(arguments.quadrig, ours, surface)
                peer = folder / f"{path.stem}-peer-{2 * found['quads']}.obj"
                if not peer.exists():
                    command = arguments.peer.format(input=surface, output=peer, triangles=2 * found["quads"])
                    subprocess.run(shlex.split(command), capture_output=True, check=True)
                theirs, _, other = figures(arguments.quadrig, peer, surface)
                positions, faces = read(surface)
                area = 0
                for a, b, c in faces:
                    u = [q - p for p, q in zip(positions[a - 1], positions[b - 1])]
                    v = [q - p for p, q in zip(positions[a - 1], positions[c - 1])]
                    area += math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2
                diagonal = math.dist(*[[f(x) for x in zip(*positions)] for f in (min, max)])
                edge = math.sqrt(area / found["quads"]) / diagonal * 1e4
                # Where the simplifier stops early its error is that of more triangles.
                ratio = error / theirs * 2 * found["quads"] / other["faces"]
                ratios.append(ratio)
                far.append(farthest / edge)
                shape = found["scaled_jacobian"]
                print(f"| {path.stem} {quads} | {found['quads']} | {shape['average']:.3f} / {shape['minimum']:.2f} | {error:.2f} | {theirs:.2f} "
                      f"| {ratio:.2f} | {farthest / edge:.2f} |", flush=True)
    if ratios:
        print(f"\nMedian ratio {statistics.median(ratios):.2f}, largest {max(ratios):.2f}; farthest {max(far):.2f} edges, of {len(ratios)}.")


if __name__ == "__main__":
    main()
