"""quadrig beside QuadriFlow, as Blender has it, in one run: a table in Markdown.

    python3 bench/quadriflow.py [--quads N,N...] QUADRIG SURFACE[,RIG.tgf,WEIGHTS.dmat]...

Needs `blender` on the path (Debian: apt-get install --no-install-recommends blender). Each program runs alone, three times; the
least user CPU seconds count. QuadriFlow's are those of its operator alone, without Blender's start and without files; quadrig's are
those of the whole process, reading and writing included. Both results are judged by `quadrig stats`."""
import argparse
import json
import pathlib
import resource
import subprocess
import tempfile

BLENDER = '''
import bpy, json, resource, sys
surface, out, quads = sys.argv[sys.argv.index("--") + 1:]
positions, faces = json.load(open(surface))
mesh = bpy.data.meshes.new("surface")
mesh.from_pydata(positions, [], faces)
item = bpy.data.objects.new("surface", mesh)
bpy.context.collection.objects.link(item)
bpy.context.view_layer.objects.active = item
item.select_set(True)
begin = resource.getrusage(resource.RUSAGE_SELF).ru_utime
done = bpy.ops.object.quadriflow_remesh(use_mesh_symmetry=False, mode="FACES", target_faces=int(quads), seed=0)
seconds = resource.getrusage(resource.RUSAGE_SELF).ru_utime - begin
with open(out, "w") as file:
    for v in item.data.vertices:
        file.write("v %.17g %.17g %.17g\\n" % tuple(v.co))
    for p in item.data.polygons:
        file.write("f " + " ".join(str(i + 1) for i in p.vertices) + "\\n")
print("\\nQUADRIFLOW", seconds, "FINISHED" in done)
'''


def read(path):
    positions, faces = [], []
    if path.suffix == ".off":
        words = path.read_text().split()
        vertices, polygons = int(words[1]), int(words[2])
        numbers = list(map(float, words[4:4 + 3 * vertices]))
        positions = [numbers[3 * i:3 * i + 3] for i in range(vertices)]
        at = 4 + 3 * vertices
        for _ in range(polygons):
            count = int(words[at])
            faces.append(list(map(int, words[at + 1:at + 1 + count])))
            at += 1 + count
    else:
        for line in path.read_text().splitlines():
            if line.startswith("v "):
                positions.append(list(map(float, line.split()[1:4])))
            elif line.startswith("f "):
                faces.append([int(corner.split("/")[0]) - 1 for corner in line.split()[1:]])
    return positions, faces


def quadriflow(folder, surface, quads):
    (folder / "surface.json").write_text(json.dumps(read(surface)))
    (folder / "quadriflow.py").write_text(BLENDER)
    out, best = folder / "quadriflow.obj", None
    for _ in range(3):
        out.unlink(missing_ok=True)
        text = subprocess.run(["blender", "-b", "--factory-startup", "--python", folder / "quadriflow.py", "--",
                               folder / "surface.json", out, str(quads)], capture_output=True, text=True).stdout
        lines = [line.split() for line in text.splitlines() if line.startswith("QUADRIFLOW")]
        if not lines or lines[0][2] != "True":
            return None, None
        best = min(best or 1e9, float(lines[0][1]))
    return best, out


def quadrig_seconds(command):
    best = None
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        if subprocess.run(command, capture_output=True).returncode:
            return None
        used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        best = min(best or 1e9, used)
    return best


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("quadrig")
    parser.add_argument("surfaces", nargs="+", metavar="SURFACE[,RIG,WEIGHTS]")
    parser.add_argument("--quads", default="2000")
    arguments = parser.parse_args()
    print("| surface | | quads | CPU s | irregular | SJ avg / min | inverted | joints | all |")
    print("|---|---|---|---|---|---|---|---|---|")
    for entry in arguments.surfaces:
        surface, *rig = map(pathlib.Path, entry.split(","))
        rig_options = ["--rig", rig[0], "--weights", rig[1]] if rig else []
        for quads in map(int, arguments.quads.split(",")):
            with tempfile.TemporaryDirectory() as name:
                folder = pathlib.Path(name)
                ours = folder / "quadrig.obj"
                results = [("QuadriFlow", *quadriflow(folder, surface, quads))]
                for title, options in [("quadrig", rig_options), ("quadrig, static", ["--preset", "static"])][:1 + bool(rig)]:
                    out = ours.with_stem(title.replace(", ", "-"))
                    seconds = quadrig_seconds([arguments.quadrig, "remesh", surface, *options, "--quads", str(quads), "-o", out])
                    results.append((title, seconds, out))
                for title, seconds, out in results:
                    if seconds is None:
                        print(f"| {surface.stem} {quads} | {title} | failed | | | | | | |")
                        continue
                    stats = [arguments.quadrig, "stats", out, "--json", "--input", surface, *rig_options]
                    figures = json.loads(subprocess.run(stats, capture_output=True, text=True).stdout)["meshes"][0]
                    if not figures["quads"]:
                        print(f"| {surface.stem} {quads} | {title} | made no quads | | | | | | |")
                        continue
                    shape, bending = figures["scaled_jacobian"], figures.get("deformation")
                    print(f"| {surface.stem} {quads} | {title} | {figures['quads']} | {seconds:.2f} | {figures['irregular_interior']} "
                          f"| {shape['average']:.3f} / {shape['minimum']:.2f} | {100 * shape['negative']:.2f} % "
                          + (f"| {bending['joints']['rms']:.2f} | {bending['all']['rms']:.2f} |" if bending else "| | |"), flush=True)


if __name__ == "__main__":
    main()
