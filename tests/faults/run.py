#!/usr/bin/env python3
"""Attacks the command and the C interface (docs/security.md). Last line: N tried, N fell.

usage: run.py COMMAND HOST FAILING_ALLOCATIONS [--only PART]... [--all]
PART: overwrites, devices, kills, memory, bombs, allocations. --all: every allocation of each job fails once, not some."""

import argparse
import itertools
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
import bombs  # noqa: E402

tried = fell = 0


def judge(ok, what, detail=""):
    global tried, fell
    tried += 1
    if not ok:
        fell += 1
        print("FELL %s: %s" % (what, str(detail).strip()[-400:]), flush=True)
    return ok


def part(name):
    print("== %s (%d tried, %d fell so far)" % (name, tried, fell), flush=True)


class Result:
    def __init__(self, code, error, cpu):
        self.code, self.error, self.cpu = code, error, cpu

    def sentence(self):
        return self.error.startswith("quadrig: ") and self.error.endswith("\n")

    def __str__(self):
        return "code %s, %.1f s, %r" % (self.code, self.cpu, self.error[-300:])


def run(words, cwd=None, limits=(), environment=None, wall=120, stdout=subprocess.DEVNULL):
    """limits: (RLIMIT_..., value) each. A code below 0 is a signal; None: it did not end."""

    def limit():
        for which, value in limits:
            resource.setrlimit(which, (value, value))

    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(words, cwd=cwd, stdout=stdout, stderr=errors, stdin=subprocess.DEVNULL,
                                   preexec_fn=limit if limits else None, env={**os.environ, **(environment or {})})
        end = time.monotonic() + wall
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                process.returncode = code = os.waitstatus_to_exitcode(status)
                break
            if time.monotonic() > end:
                process.kill()
                _, status, usage = os.wait4(process.pid, 0)
                process.returncode, code = -9, None
                break
            time.sleep(0.002)
        errors.seek(0)
        return Result(code, errors.read().decode(errors="replace"), usage.ru_utime + usage.ru_stime)


def everything(folder):
    found = {}
    for place, folders, files in os.walk(folder):
        for name in files + folders:
            path = os.path.join(place, name)
            if os.path.isfile(path) and not os.path.islink(path):
                with open(path, "rb") as file:
                    found[path] = file.read()
            else:
                found[path] = None
    return found


def write(path, contents):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "wb") as file:
        file.write(contents if isinstance(contents, bytes) else contents.encode())
    return path


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
PNG = b"\x89PNG\r\n\x1a\n of no use"


def small_files(folder, command):
    write(os.path.join(folder, "mesh.obj"), TETRAHEDRON)
    write(os.path.join(folder, "rig.tgf"), "1 0 0 0\n2 1 0 0\n3 1 1 0\n#\n1 2\n2 3\n#\n")
    write(os.path.join(folder, "weights.dmat"), "2 4\n1 0.5 1 0.5\n0 0.5 0 0.5\n")
    write(os.path.join(folder, "tube.glb"), bombs.tube(2, sides=6, rings=6).bytes())
    document = bombs.tube(2, sides=6, rings=6).json
    build = bombs.tube(2, sides=6, rings=6)
    write(os.path.join(folder, "buffer.bin"), build.binary)
    document["buffers"] = [{"byteLength": len(build.binary), "uri": "buffer.bin"}]
    document["images"] = [{"uri": "skin%20one.png"}, {"uri": "sub/two.png"}, {"uri": "../far.png"}, {"uri": "not_there.png"}]
    write(os.path.join(folder, "asset.gltf"), bombs.json.dumps(document))
    write(os.path.join(folder, "skin one.png"), PNG)
    write(os.path.join(folder, "sub", "two.png"), PNG)
    write(os.path.join(os.path.dirname(folder), "far.png"), PNG)


def overwrites(tools, scratch):
    """Every output option against every file that inputs are or name, by every spelling and link."""
    folder = os.path.join(scratch, "in")
    out = os.path.join(scratch, "out")
    os.makedirs(out)
    small_files(folder, tools.command)
    inputs = {"obj": ["mesh.obj", "rig.tgf", "weights.dmat"],
              "gltf": ["asset.gltf", "buffer.bin", "skin one.png", "sub/two.png", "../far.png", "not_there.png"]}
    os.symlink("../in", os.path.join(out, "folder"))

    def spellings(name, k):
        path = os.path.normpath(os.path.join(folder, name))
        yield path
        yield os.path.join(os.path.dirname(path), ".", os.path.basename(folder), "..", os.path.basename(path)) \
            if os.path.isdir(os.path.join(os.path.dirname(path), os.path.basename(folder))) else \
            os.path.join(folder, "sub", "..", os.path.relpath(path, folder))
        yield os.path.join(out, "folder", os.path.relpath(path, folder))
        yield os.path.relpath(path, scratch)
        link, hard = os.path.join(out, "link%d" % k), os.path.join(out, "hard%d" % k)
        if not os.path.islink(link):
            os.symlink(path, link)
        yield link
        if os.path.exists(path):
            if not os.path.exists(hard):
                os.link(path, hard)
            yield hard

    rig = ["--rig", "in/rig.tgf", "--weights", "in/weights.dmat"]
    jobs = {"obj": [(["remesh", "in/mesh.obj", *rig, "--quads", "30", "-o", "out/q.obj"], ["--report", "--weights-out"]),
                    (["field", "in/mesh.obj", *rig], ["--report"]), (["dominance", "in/mesh.obj", *rig], ["--report"]),
                    (["stats", "in/mesh.obj", "--input", "in/mesh.obj", *rig], ["--report"])],
            "gltf": [(["remesh", "in/asset.gltf", "--quads", "30", "-o", "out/q.glb"], ["--report"]),
                     (["remesh", "in/asset.gltf", "--quads", "30", "-o", "out/q.gltf", "--force"], ["--report"]),
                     (["stats", "in/mesh.obj", "--input", "in/asset.gltf"], ["--report"]),
                     (["stats", "in/asset.gltf"], ["--report"]), (["field", "in/asset.gltf"], ["--report"])]}
    for kind in inputs:
        for k, name in enumerate(inputs[kind]):
            for spelled in spellings(name, "%s%d" % (kind, k) and k + (10 if kind == "gltf" else 0)):
                before = everything(scratch)
                for words, options in jobs[kind]:
                    for option in options:
                        result = run([tools.command, *words, option, spelled], cwd=scratch)
                        judge(result.code == 2 and result.sentence() and everything(scratch) == before,
                              "overwrites: %s %s %s" % (" ".join(words), option, spelled), result)
    before = everything(scratch)
    for words in (["copy", "in/asset.gltf", "out/folder/asset.gltf"], ["copy", "in/asset.gltf", "out/folder/asset.gltf", "--force"],
                  ["remesh", "in/tube.glb", "--quads", "30", "-o", "in/tube.glb"]):
        result = run([tools.command, *words], cwd=scratch)
        judge(result.code == 2 and everything(scratch) == before, "overwrites: " + " ".join(words), result)
    result = run([tools.host, "in/tube.glb", "out/folder/../in/tube.glb"], cwd=scratch)
    judge(result.code == 2 and everything(scratch) == before, "overwrites: C", result)
    # Names of images: hidden, pipes, what is none, links that lead out.
    for k, (uri, contents) in enumerate([(".bashrc", PNG), (".ssh/authorized_keys", PNG), ("a/.b/c.png", PNG), ("%2eprofile", PNG),
                                         ("notes.txt", b"text"), ("empty.png", b""), ("pipe", None), ("../up.png", PNG)]):
        place = os.path.join(scratch, "names%d" % k)
        document = bombs.tube(2, sides=6, rings=6)
        document.json["images"] = [{"uri": uri}]
        write(os.path.join(place, "in", "a.glb"), document.bytes())
        name = os.path.join(place, "in", uri.replace("%2e", "."))
        if contents is None:
            os.mkfifo(name)
        else:
            write(name, contents)
        os.makedirs(os.path.join(place, "out"))
        for words in (["copy", "in/a.glb", "out/b.glb"], ["copy", "in/a.glb", "out/b.gltf", "--force"],
                      ["remesh", "in/a.glb", "--quads", "30", "-o", "out/b.glb"]):
            result = run([tools.command, *words], cwd=place)
            left = sorted(os.listdir(os.path.join(place, "out")))
            refused = result.code in (3, 4) and result.sentence() and not left
            judge(refused or (uri.startswith("..") and result.code == 0 and set(left) <= {"b.glb", "b.gltf", "b.bin"}),
                  "names: %s %s" % (uri, " ".join(words)), result)
            for one in left:
                os.remove(os.path.join(place, "out", one))


def devices(tools, scratch):
    small_files(os.path.join(scratch, "in"), tools.command)
    os.makedirs(os.path.join(scratch, "out"))
    rig = ["--rig", "in/rig.tgf", "--weights", "in/weights.dmat"]
    before = everything(scratch)
    for words in (["remesh", "in/mesh.obj", *rig, "--quads", "30", "-o", "out/q.obj", "--report", "/dev/full"],
                  ["remesh", "in/mesh.obj", *rig, "--quads", "30", "-o", "out/q.obj", "--weights-out", "/dev/full"],
                  ["remesh", "in/asset.gltf", "--quads", "30", "-o", "out/q.glb", "--report", "/dev/full"],
                  ["remesh", "in/tube.glb", "--quads", "30,20", "-o", "out/q.gltf", "--report", "out/none/r.json"],
                  ["field", "in/mesh.obj", *rig, "-o", "out/f.obj", "--report", "/dev/full"],
                  ["dominance", "in/mesh.obj", *rig, "-o", "out/d.ply", "--report", "/dev/full"]):
        result = run([tools.command, *words], cwd=scratch)
        judge(result.code == 3 and result.sentence() and everything(scratch) == before, "devices: " + " ".join(words), result)
    with open("/dev/full", "wb") as full:
        for words in (["stats", "in/mesh.obj"], ["stats", "in/mesh.obj", "--json"]):
            result = run([tools.command, *words], cwd=scratch, stdout=full)
            judge(result.code == 3 and everything(scratch) == before, "devices: stdout of " + " ".join(words), result)
    # Nobody reads what is printed: the work is done all the same, and the verdict (9: triangles are no quads) is the same.
    for words in (["stats", "in/mesh.obj"], ["stats", "in/mesh.obj", "--json"], ["dominance", "in/mesh.obj", *rig]):
        verdict = 9 if words[0] == "stats" else 0
        reads, writes = os.pipe()
        os.close(reads)
        result = run([tools.command, *words], cwd=scratch, stdout=writes)
        os.close(writes)
        judge(result.code == verdict and everything(scratch) == before, "devices: closed pipe of " + " ".join(words), result)
    # A file size limit: writing fails as on a full disk.
    big = ["sample", "pear", "-o", "out/pear", "--triangles", "20000"]
    result = run([tools.command, *big], cwd=scratch, limits=[(resource.RLIMIT_FSIZE, 50_000)])
    judge(result.code == 3 and result.sentence() and everything(scratch) == before, "devices: file size limit", result)
    # A small and a read-only file system, where this machine lets us have them.
    script = ("mount -t tmpfs -o size=64k none out && %s; code=$?; ls -A out; exit $code")
    inner = "'%s' sample pear -o out/pear --triangles 20000" % tools.command
    for name, mounted in (("full", script % inner),
                          ("read-only", (script % inner).replace("size=64k", "size=64m,ro"))):
        probe = subprocess.run(["unshare", "-rm", "sh", "-c", "mount -t tmpfs none out"], cwd=scratch, capture_output=True)
        if probe.returncode != 0:
            print("devices: no %s file system to be had here: not tried" % name)
            continue
        done = subprocess.run(["unshare", "-rm", "sh", "-c", mounted], cwd=scratch, capture_output=True, text=True)
        judge(done.returncode == 3 and done.stdout == "", "devices: %s file system" % name, done)


def kills(tools, scratch):
    folder = os.path.join(scratch, "in")
    small_files(folder, tools.command)
    run([tools.command, "sample", "pear", "-o", folder, "--triangles", "3000"])
    words = [tools.command, "remesh", "in/pear.obj", "--rig", "in/pear.tgf", "--weights", "in/pear.dmat", "--quads", "400",
             "-o", "out/q.obj", "--weights-out", "out/w.dmat", "--report", "out/r.json"]
    out = os.path.join(scratch, "out")
    os.makedirs(out)
    begun = time.monotonic()
    run(words, cwd=scratch)
    whole = time.monotonic() - begun
    random.seed(1)
    for k in range(60):
        for name in os.listdir(out):
            os.remove(os.path.join(out, name))
        which = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGPIPE, signal.SIGXFSZ, signal.SIGTERM, signal.SIGKILL)[k % 7]
        # Half of them at the end, when files are written.
        wait = whole * (random.uniform(0.85, 1.05) if k % 2 else random.uniform(0, 1))
        process = subprocess.Popen(words, cwd=scratch, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        time.sleep(wait)
        process.send_signal(which)
        if k % 3 == 0 and which != signal.SIGKILL:
            process.send_signal(which)
        error = process.communicate(timeout=60)[1].decode()
        left = sorted(os.listdir(out))
        whole_set = left in ([], ["q.obj", "r.json", "w.dmat"])
        ended = process.returncode in (0, 8, -which)
        judge(whole_set and ended, "kills: %s after %.3f s" % (which.name, wait), "%s, left %s, %s" % (process.returncode, left, error))


def memory(tools, scratch):
    folder = os.path.join(scratch, "in")
    small_files(folder, tools.command)
    run([tools.command, "sample", "pear", "-o", folder, "--triangles", "12000"])
    out = os.path.join(scratch, "out")
    os.makedirs(out)
    jobs = {"remesh": [tools.command, "remesh", "in/pear.obj", "--rig", "in/pear.tgf", "--weights", "in/pear.dmat", "--quads",
                       "1000", "-o", "out/q.obj"],
            "C": [tools.host, "in/tube.glb", "out/q.glb"]}
    for megabytes, threads, job in itertools.product(range(60, 601, 60), (1, 2, 4), jobs):
        for name in os.listdir(out):
            os.remove(os.path.join(out, name))
        words = jobs[job] + ([str(threads)] if job == "C" else ["--threads", str(threads)])
        result = run(words, cwd=scratch, limits=[(resource.RLIMIT_AS, megabytes << 20)])
        left = os.listdir(out)
        judge((result.code == 0 and len(left) == 1) or (result.code == 10 and result.sentence() and not left),
              "memory: %s, %d MB, %d threads" % (job, megabytes, threads), "%s, left %s" % (result, left))


def run_bombs(tools, scratch):
    for name, words in bombs.bombs(scratch):
        out = os.path.join(scratch, "out")
        for one in os.listdir(out):
            os.remove(os.path.join(out, one))
        result = run([tools.command, "--threads", "1", *words], limits=[(resource.RLIMIT_AS, 1 << 30), (resource.RLIMIT_CPU, 10)])
        left = os.listdir(out)
        done = result.code in (0, 9) and left
        refused = result.code in (2, 3, 4, 5, 6, 7) and left in ([], ["r.json"]) and "quadrig: " in result.error
        judge(done or refused, "bombs: " + name, "%s, left %s" % (result, left))


def allocations(tools, scratch):
    small_files(os.path.join(scratch, "in"), tools.command)
    out = os.path.join(scratch, "out")
    log = os.path.join(scratch, "log")
    # Outputs are called out...: the children of `each` write them too.
    jobs = {
        "OBJ": ([tools.command, "remesh", "in/mesh.obj", "--rig", "in/rig.tgf", "--weights", "in/weights.dmat", "--quads", "30",
                 "-o", "out/out.obj", "--weights-out", "out/out.dmat", "--report", "out/out.json"], 3),
        "GLB": ([tools.command, "remesh", "in/tube.glb", "--quads", "60", "-o", "out/out.gltf", "--report", "out/out.json"], 3),
        "copy": ([tools.command, "copy", "in/asset.gltf", "out/out.gltf", "-q"], 4),
        "C": ([tools.host, "in/tube.glb", "out/out.glb"], 1)}
    everything_else = {"LD_PRELOAD": tools.failing, "QUADRIG_FAULTS_LOG": log, "QUADRIG_FAULTS_FOLDER": out}

    def fresh():
        shutil.rmtree(out, ignore_errors=True)
        os.makedirs(out)
        if os.path.exists(log):
            os.remove(log)

    for name, (words, files) in jobs.items():
        def on(threads):
            return words + ([str(threads)] if name == "C" else ["--threads", str(threads)])

        fresh()
        counted = run(on(1), cwd=scratch, environment={**everything_else, "QUADRIG_FAULTS": "count"})
        total = int(open(log).read().split()[-1])
        judge(counted.code == 0, "allocations: %s" % name, counted)
        fresh()
        step = 1 if tools.all else max(1, total // 1500)
        done = 1 if name == "copy" else files  # `copy` makes files of the names of its images too: those are counted below
        forked = run(on(1), cwd=scratch, wall=1200, environment={
            **everything_else, "QUADRIG_FAULTS": "each", "QUADRIG_FAULTS_STEP": str(step), "QUADRIG_FAULTS_DONE": str(files)})
        lines = open(log).read().splitlines()
        judge(forked.code == 0, "allocations: %s, forked" % name, forked)
        reached = total
        for line in lines:
            if line.startswith("writing "):
                reached = int(line.split()[1])
            elif not line.startswith("allocations "):
                judge(False, "allocations: %s, number %s" % (name, line))
        global tried
        tried += max(0, reached // step - len(lines) + 2)
        # While files are put in place a fork would meddle with them; and with several threads it has only one of them.
        numbers = [(1, n) for n in range(reached, total + 1)]
        numbers = numbers if tools.all else numbers[::max(1, len(numbers) // 60)]
        numbers += [(4, n) for n in range(1, total + 1, max(1, total // (400 if tools.all else 60)))]
        for threads, n in numbers:
            fresh()
            result = run(on(threads), cwd=scratch, environment={**everything_else, "QUADRIG_FAULTS": str(n)})
            left = sorted(os.listdir(out))
            judge((result.code == 0 and len(left) == files) or
                  (result.code not in (None, 0, 1) and 0 < result.code <= 12 and result.sentence() and not left),
                  "allocations: %s, number %d of %d, %d threads" % (name, n, total, threads), "%s, left %s" % (result, left))


def main():
    parts = {"overwrites": overwrites, "devices": devices, "kills": kills, "memory": memory, "bombs": run_bombs,
             "allocations": allocations}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", type=os.path.abspath)
    parser.add_argument("host", type=os.path.abspath)
    parser.add_argument("failing", type=os.path.abspath)
    parser.add_argument("--only", action="append", choices=list(parts))
    parser.add_argument("--all", action="store_true")
    tools = parser.parse_args()
    for name, attack in parts.items():
        if tools.only and name not in tools.only:
            continue
        part(name)
        with tempfile.TemporaryDirectory(prefix="quadrig-faults-") as scratch:
            attack(tools, os.path.join(scratch, "a") if os.mkdir(os.path.join(scratch, "a")) is None else scratch)
    print("%d tried, %d fell" % (tried, fell))
    return 1 if fell else 0


if __name__ == "__main__":
    sys.exit(main())
