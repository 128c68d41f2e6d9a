"""Small files that ask for much: each at most 1 MB, made by code. bombs(folder) yields (name, words for the command)."""

import json
import math
import os
import random
import struct


def glb(document, binary):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    size = 28 + len(text) + len(binary)
    head = struct.pack("<4sIIII", b"glTF", 2, size, len(text), 0x4E4F534A)
    return head + text + struct.pack("<II", len(binary), 0x004E4942) + binary


class Builder:
    """A glTF file whose accessors are appended one by one."""

    def __init__(self):
        self.binary = b""
        self.json = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": [], "meshes": [], "nodes": []}

    def accessor(self, kind, component, rows):
        code = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}[component]
        data = b"".join(struct.pack("<%d%s" % (len(row), code), *row) for row in rows)
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data
        return self.add(kind, component, len(rows), bufferView=len(self.json["bufferViews"]) - 1)

    def add(self, kind, component, count, **more):
        self.json["accessors"].append({"type": kind, "componentType": component, "count": count, **more})
        return len(self.json["accessors"]) - 1

    def bytes(self):
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        return glb(self.json, self.binary)


def tube_rows(sides, rings):
    points = [(math.cos(6.2831853 * s / sides), 4.0 * r / rings, math.sin(6.2831853 * s / sides))
              for r in range(rings + 1) for s in range(sides)]
    corners = []
    for r in range(rings):
        for s in range(sides):
            a, b = r * sides + s, r * sides + (s + 1) % sides
            corners += [(a,), (a + sides,), (b,), (b,), (a + sides,), (b + sides,)]
    return points, corners


def tube(joints=2, parent=lambda j: j - 1, sides=12, rings=16, weighted=None):
    """A tube that bends by the first `weighted` of its joints."""
    build = Builder()
    points, corners = tube_rows(sides, rings)
    weighted = joints if weighted is None else weighted
    build.points = len(points)
    attributes = {"POSITION": build.accessor("VEC3", 5126, points)}
    if joints:
        of = [min(weighted - 1, int(weighted * p[1] / 4.0001)) for p in points]
        attributes["JOINTS_0"] = build.accessor("VEC4", 5123, [(j, 0, 0, 0) for j in of])
        attributes["WEIGHTS_0"] = build.accessor("VEC4", 5126, [(1, 0, 0, 0)] * len(points))
    build.primitive = {"attributes": attributes, "indices": build.accessor("SCALAR", 5125, corners)}
    build.json["meshes"] = [{"primitives": [build.primitive]}]
    nodes = build.json["nodes"]
    for j in range(joints):
        nodes.append({"translation": [0, 4.0 / joints, 0]})
        if parent(j) >= 0:
            nodes[parent(j)].setdefault("children", []).append(j)
    nodes.append({"mesh": 0})
    if joints:
        nodes[-1]["skin"] = 0
        build.json["skins"] = [{"joints": list(range(joints))}]
    build.json["scenes"] = [{"nodes": [n for n in range(joints) if parent(n) < 0] + [joints]}]
    return build


def needle_obj(sides, length, count=1):
    text = []
    for k in range(count):
        base = k * (sides + 2)
        text += ["v %g %g %g" % (math.cos(6.2831853 * s / sides) + 5 * k, math.sin(6.2831853 * s / sides), 0)
                 for s in range(sides)]
        text += ["v %g 0 %g" % (5 * k, length), "v %g 0 -0.1" % (5 * k)]
        for s in range(sides):
            a, b = base + s + 1, base + (s + 1) % sides + 1
            text += ["f %d %d %d" % (a, b, base + sides + 1), "f %d %d %d" % (b, a, base + sides + 2)]
    return "\n".join(text) + "\n"


def noisy_sphere_obj(rings, noise):
    rolled = random.Random(3)
    text = []
    for r in range(rings + 1):
        for s in range(2 * rings):
            radius = 1 + rolled.uniform(-noise, noise)
            up, turn = math.pi * r / rings, math.pi * s / rings
            text.append("v %.4f %.4f %.4f" % (radius * math.sin(up) * math.cos(turn), radius * math.sin(up) * math.sin(turn),
                                              radius * math.cos(up)))
    for r in range(rings):
        for s in range(2 * rings):
            a, b = 2 * r * rings + s + 1, 2 * r * rings + (s + 1) % (2 * rings) + 1
            text += ["f %d %d %d" % (a, a + 2 * rings, b), "f %d %d %d" % (b, a + 2 * rings, b + 2 * rings)]
    return "\n".join(text) + "\n"


def bombs(folder):
    def put(name, contents):
        path = os.path.join(folder, name)
        with open(path, "wb") as file:
            file.write(contents if isinstance(contents, bytes) else contents.encode())
        assert os.path.getsize(path) <= 1_000_000, (name, os.path.getsize(path))
        return path

    out = os.path.join(folder, "out")
    os.makedirs(out, exist_ok=True)

    def gltf(name, build, *more):
        path = put(name + ".glb", build if isinstance(build, bytes) else build.bytes())
        return name, ["remesh", path, "--quads", "300", "-o", os.path.join(out, "out.glb"), *more]

    def surface(name, contents, *more, extension="obj"):
        path = put(name + "." + extension, contents)
        return name, ["remesh", path, "--quads", "300", "-o", os.path.join(out, "out.obj"), *more]

    # Joints.
    root = lambda j: -1
    yield gltf("siblings_5000", tube(5000, lambda j: 0 if j else -1))
    yield gltf("siblings_5000_unweighted", tube(5000, lambda j: 0 if j else -1, weighted=2))
    yield gltf("roots_5000", tube(5000, root, weighted=3))
    yield gltf("chain_4000", tube(4000))
    yield gltf("chain_4000_unweighted", tube(4000, weighted=2))
    yield gltf("siblings_12000", tube(12000, lambda j: 0 if j else -1, rings=20))
    yield gltf("tree_8000", tube(8000, lambda j: (j - 1) // 2 if j else -1))
    build = tube(2)
    build.json["skins"] *= 3000
    build.json["nodes"] += [{"mesh": 0, "skin": k} for k in range(3000)]
    yield gltf("skins_3000", build)
    build = tube(200)
    build.json["skins"] *= 300
    build.json["nodes"] += [{"mesh": 0, "skin": k} for k in range(300)]
    yield gltf("skins_300_of_200", build)
    build = tube(2)
    build.json["nodes"] += [{"mesh": 0, "skin": 0}] * 20000
    yield gltf("instances_20000", build)
    build = tube(0)
    build.json["nodes"] += [{"mesh": 0}] * 30000
    yield gltf("static_instances_30000", build, "--all")
    build = tube(2)
    build.json["nodes"] = [{"children": [k + 1]} for k in range(20000)] + [{"mesh": 0}]
    build.json.pop("skins")
    yield gltf("node_chain_20000", build)
    build = tube(3)
    build.json["nodes"][2]["children"] = [0]
    yield gltf("node_ring", build)

    path = put("stats_siblings.glb", tube(5000, lambda j: 0 if j else -1).bytes())
    yield "stats_siblings_5000", ["stats", put("stats.obj", needle_obj(8, 1)), "--input", path, "--report",
                                  os.path.join(out, "r.json")]

    # Accessors.
    for name, count in [("no_view", 80_000_000), ("no_view_more", 2_000_000_000)]:
        build = Builder()
        build.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": build.add("VEC3", 5126, count)}}]}]
        build.json["nodes"] = [{"mesh": 0}]
        yield gltf(name, build)
    build = tube(2)
    build.json["accessors"].append({"type": "VEC3", "componentType": 5126, "count": 60_000_000, "sparse": {
        "count": 1, "indices": {"bufferView": 0, "componentType": 5125}, "values": {"bufferView": 0}}})
    build.primitive["attributes"]["POSITION"] = len(build.json["accessors"]) - 1
    yield gltf("sparse", build)
    build = tube(2)
    build.primitive["indices"] = build.add("SCALAR", 5125, 80_000_000)
    yield gltf("indices_without_view", build)
    build = tube(2, sides=100, rings=120)
    build.json["meshes"][0]["primitives"] = [build.primitive] * 1000
    yield gltf("primitives_1000", build)
    build = tube(2, sides=100, rings=120)
    build.json["meshes"][0]["primitives"] = [{"attributes": build.primitive["attributes"]}] * 3000
    yield gltf("primitives_3000_without_indices", build)
    build = tube(2, sides=100, rings=100)
    build.json["meshes"] = build.json["meshes"] * 500
    build.json["nodes"] += [{"mesh": k, "skin": 0} for k in range(500)]
    yield gltf("meshes_500", build)
    build = tube(2)
    for k in range(4000):
        build.primitive["attributes"]["TEXCOORD_%d" % k] = build.primitive["attributes"]["POSITION"]
        build.primitive["attributes"]["_A%d" % k] = build.primitive["attributes"]["POSITION"]
    yield gltf("attributes_8000", build)
    build = tube(2)
    for k in range(1, 3000):
        build.primitive["attributes"]["JOINTS_%d" % k] = build.primitive["attributes"]["JOINTS_0"]
        build.primitive["attributes"]["WEIGHTS_%d" % k] = build.primitive["attributes"]["WEIGHTS_0"]
    yield gltf("influences_12000", build)
    build = tube(2)
    position = build.primitive["attributes"]["POSITION"]
    build.primitive["attributes"]["NORMAL"] = position
    build.primitive["targets"] = [{"POSITION": position, "NORMAL": position}] * 20000
    yield gltf("targets_20000", build)
    build = tube(2, sides=40, rings=100)
    position = build.primitive["attributes"]["POSITION"]
    build.primitive["targets"] = [{"POSITION": position}] * 20000
    yield gltf("targets_20000_of_4000", build)
    build = tube(2)
    view = build.json["bufferViews"][0]
    view["extensions"] = {"EXT_meshopt_compression": {"buffer": 0, "byteLength": 100, "byteStride": 12,
                                                      "count": 300_000_000, "mode": "ATTRIBUTES"}}
    yield gltf("meshopt_count", build)
    build = tube(2)
    build.primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    yield gltf("draco_noise", build)
    build = tube(2, sides=100, rings=100)
    build.json["bufferViews"] += [dict(build.json["bufferViews"][0]) for _ in range(2000)]
    build.json["accessors"] += [dict(build.json["accessors"][0], bufferView=4 + k) for k in range(2000)]
    build.json["meshes"][0]["primitives"] = [
        {"attributes": dict(build.primitive["attributes"], POSITION=4 + k), "indices": build.primitive["indices"]}
        for k in range(500)]
    yield gltf("views_2000", build)

    # Clips.
    build = tube(2)
    time = build.accessor("SCALAR", 5126, [(0,), (1e9,)])
    turn = build.accessor("VEC4", 5126, [(0, 0, 0, 1), (0, 0, 1, 0)])
    build.json["animations"] = [{"samplers": [{"input": time, "output": turn}], "channels": [
        {"sampler": 0, "target": {"node": 1, "path": "rotation"}}]}]
    yield gltf("clip_of_30_years", build, "--poses", "clips")
    build = tube(1000)
    time = build.accessor("SCALAR", 5126, [(k / 10,) for k in range(2000)])
    turn = build.accessor("VEC4", 5126, [(0, 0, 0, 1)] * 2000)
    build.json["animations"] = [{"samplers": [{"input": time, "output": turn}], "channels": [
        {"sampler": 0, "target": {"node": k, "path": "rotation"}} for k in range(1000)]}] * 10
    yield gltf("clips_10_of_1000", build, "--poses", "clips")

    # JSON.
    build = tube(2)
    build.json["extras"] = {str(k): k for k in range(40000)}
    yield gltf("members_40000", build)
    build = tube(2)
    build.json["images"] = [{"uri": "%d/../x%d.png" % (k, k)} for k in range(20000)]
    yield gltf("images_20000", build)
    build = tube(2)
    build.json["images"] = [{"uri": "./" * 2000 + "x%d" % k} for k in range(200)]
    yield gltf("images_of_long_names", build)
    text = b'{"asset":{"version":"2.0"},"extras":' + b"[" * 400000 + b"]" * 400000 + b"}"
    yield gltf("nesting", struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text)
    build = tube(2)
    build.json["materials"] = [{"name": "m%d" % k} for k in range(15000)]
    primitive = build.primitive
    build.json["meshes"][0]["primitives"] = [dict(primitive, material=k) for k in range(2000)]
    yield gltf("materials_2000", build)

    # Selection by expressions that go back over what they read.
    build = tube(2)
    build.json["nodes"][-1]["name"] = "a" * 200 + "!"
    for k, expression in enumerate(["(a+)+", "(a|aa)+", "(.*)*x", "a" * 3000 + ".*" * 20 + "b", "((a?){1000}){1000}"]):
        yield gltf("select_%d" % k, build, "--select", expression)

    # Surfaces.
    yield surface("polygon_60000", "\n".join("v %g %g 0" % (math.cos(k / 9549.3), math.sin(k / 9549.3))
                                           for k in range(30000)) + "\nf " + " ".join(str(k + 1) for k in range(30000)))
    yield surface("faces_of_one_edge", "v 0 0 0\nv 1 0 0\n" + "".join("v 0 %d 1\n" % k for k in range(20000)) +
                  "".join("f 1 2 %d\n" % (k + 3) for k in range(20000)))
    yield surface("same_face", "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 100000)
    yield surface("loose_triangles", "".join("v %d 0 0\nv %d 1 0\nv %d 0 1\nf -3 -2 -1\n" % (3 * k, 3 * k, 3 * k + 1)
                                             for k in range(18000)))
    yield surface("needle", needle_obj(50, 1e4))
    yield surface("needles_31", needle_obj(24, 1e4, 31))
    yield surface("needles_500", needle_obj(12, 1e4, 500))
    yield surface("fan", needle_obj(12000, 1))
    spine = put("spine.tgf", "1 0 -1 0\n2 0 0 0\n3 0 1 0\n#\n1 2\n2 3\n#\n")
    for rings, noise in ((40, 0.25), (40, 0.08), (60, 0.02)):
        yield surface("noise_%d_%g" % (rings, noise), noisy_sphere_obj(rings, noise), "--rig", spine, "--bind", "nearest",
                      "--preset", "thesis")
    yield surface("far", "v 0 0 0\nv 1e300 0 0\nv 0 1e300 0\nv 0 0 1e300\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    yield surface("ply_counts", b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n"
                  b"property float y\nproperty float z\nelement face 4000000000\nproperty list uchar int vertex_indices\n"
                  b"end_header\n", extension="ply")
    yield surface("off_counts", "OFF\n400000000 400000000 0\n0 0 0\n", extension="off")

    # Rigs.
    tetrahedron = put("tetrahedron.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    n = 2000
    joints = "".join("%d %g 0 0\n" % (k + 1, k / n) for k in range(n + 1))
    chain = put("chain.tgf", joints + "#\n" + "".join("%d %d\n" % (k + 1, k + 2) for k in range(n)) + "#\n")
    star = put("star.tgf", joints + "#\n" + "".join("1 %d\n" % (k + 2) for k in range(n)) + "#\n")
    weights = put("one.dmat", "%d 4\n" % n + "1 1 1 1\n" + "0 0 0 0\n" * (n - 1))
    for name, rig in [("tgf_chain", chain), ("tgf_star", star)]:
        yield surface(name, open(tetrahedron).read(), "--rig", rig, "--weights", weights)
        yield surface(name + "_nearest", open(tetrahedron).read(), "--rig", rig, "--bind", "nearest")
        yield surface(name + "_voxel", open(tetrahedron).read(), "--rig", rig, "--bind", "voxel")
        yield surface(name + "_biharmonic", open(tetrahedron).read(), "--rig", rig, "--bind", "biharmonic")
    ball = put("ball.obj", needle_obj(3000, 1))
    yield surface("tgf_far", open(ball).read(), "--rig",
                  put("far.tgf", "1 0 0 0\n2 1e9 0 0\n3 0 0 1\n#\n1 2\n1 3\n#\n"), "--bind", "voxel")
    yield surface("dmat_counts", open(tetrahedron).read(), "--rig", put("two.tgf", "1 0 0 0\n2 1 0 0\n#\n1 2\n#\n"),
                  "--weights", put("counts.dmat", b"0 0\n100000000 100000000\n"))
    yield surface("tgf_ring", open(tetrahedron).read(), "--rig", put("ring.tgf", joints + "#\n" + "".join(
        "%d %d\n" % (k + 1, (k + 1) % n + 1) for k in range(n)) + "#\n"), "--bind", "nearest")
