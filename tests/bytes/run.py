#!/usr/bin/env python3
"""The same bytes on every x86-64: runs the command with all vector instructions that the C library may choose by the
processor, without AVX2 and FMA, and where qemu-user is installed and asked for on an emulated processor that has neither
(which the command's own choices see too); then every further command, as other compilers and build types made it.
Every file must be equal. Last line: N passed, N failed.

usage: run.py [--few] [--emulate] [--corpus FOLDER] COMMAND..."""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile

without = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"}

# Name: words; outputs are called out.*. Inputs of later ones are outputs of earlier ones.
few = {
    "sample pear": "sample pear --triangles 2000 -o .",
    "remesh pear": "remesh pear.obj --rig pear.tgf --weights pear.dmat --quads 250 -o out.obj --weights-out out.dmat",
    "remesh box_torus": "remesh box_torus.obj --quads 300 --creases 30 -o out.obj",
    "field": "field pear.obj --rig pear.tgf --weights pear.dmat --preset thesis -o out.obj",
}
more = {
    "sample humanoid": "sample humanoid -o .",
    "sample head": "sample head -o head.glb",
    "sample box_torus": "sample box_torus -o .",
    "remesh humanoid": "remesh humanoid.obj --rig humanoid.tgf --weights humanoid.dmat --quads 1200 -o out.obj"
                       " --weights-out out.dmat",
    "remesh posed": "remesh pear.obj --rig pear.tgf --weights pear.dmat --quads 400 --density posed -o out.obj",
    "remesh slide": "remesh pear.obj --rig pear.tgf --weights pear.dmat --quads 400 --fit slide -o out.obj",
    "remesh subdivision": "remesh pear.obj --rig pear.tgf --weights pear.dmat --quads 400 --fit subdivision -o out.obj",
    "remesh head": "remesh head.glb --quads 2500 -o out.glb",
    "bind voxel": "bind humanoid.obj --rig humanoid.tgf --method voxel -o out.dmat",
    "bind biharmonic": "bind pear.obj --rig pear.tgf --method biharmonic -o out.dmat",
    "pose": "pose humanoid.obj --rig humanoid.tgf --weights humanoid.dmat --bone bone1 --axis z --angle 60 -o out.obj",
}
from_corpus = {
    "corpus arm": "remesh {0}/libigl_arm/arm.obj --rig {0}/libigl_arm/arm.tgf --weights {0}/libigl_arm/arm-weights.dmat"
                  " --quads 800 -o out.obj --weights-out out.dmat",
    "corpus man": "remesh {0}/khronos_cesiumman/CesiumMan.glb --quads 1500 -o out.glb",
    "corpus fox": "remesh {0}/khronos_fox/Fox.glb --quads 1000 --topology field --poses clips -o out.glb",
}


def run(words, arguments, scratch, inputs, environment):
    """What a run wrote, as name: hash of the bytes. Inputs are linked."""
    folder = os.path.join(scratch, "run")
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    for name in inputs:
        os.symlink(inputs[name], os.path.join(folder, name))
    done = subprocess.run([*words, "-q", *arguments.split()], cwd=folder, env={**os.environ, **environment},
                          capture_output=True, text=True)
    made = {}
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name)
        if not os.path.islink(path):
            with open(path, "rb") as file:
                made[name] = hashlib.sha256(file.read()).hexdigest()[:16]
    # Warnings are no failure: the exit code is part of what must be equal.
    return {"exit code": done.returncode, "message": done.stderr if done.returncode not in (0, 9) else "", **made}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--few", action="store_true")
    parser.add_argument("--emulate", action="store_true")
    parser.add_argument("--corpus", type=os.path.abspath)
    parser.add_argument("commands", nargs="+", type=os.path.abspath)
    options = parser.parse_args()
    jobs = {**few} if options.few else {**few, **more}
    if options.few:
        jobs["sample box_torus"] = more["sample box_torus"]
    if options.corpus and os.path.isdir(options.corpus):
        jobs.update({name: words.format(options.corpus) for name, words in from_corpus.items()})
    jobs = dict(sorted(jobs.items(), key=lambda job: not job[0].startswith("sample")))
    kinds = [("without AVX2 and FMA", [options.commands[0]], without)]
    if options.emulate:
        if shutil.which("qemu-x86_64"):
            kinds.append(("emulated", ["qemu-x86_64", "-cpu", "Nehalem", options.commands[0]], {}))
        else:
            print("no qemu-x86_64 here (Debian: qemu-user): not emulated")
    kinds += [(command, [command], {}) for command in options.commands[1:]]
    passed = failed = files = 0
    with tempfile.TemporaryDirectory(prefix="quadrig-bytes-") as scratch:
        inputs = {}
        for name, words in jobs.items():
            given = {each: inputs[each] for each in inputs if each in words}
            first = run([options.commands[0]], words, scratch, given, {})
            kept = {}
            if name.startswith("sample"):
                for each in first:
                    path = os.path.join(scratch, "run", each)
                    if os.path.exists(path):
                        kept[each] = shutil.copy(path, os.path.join(scratch, each))
            wrote = len(first) > 2 and first["exit code"] in (0, 9)
            files += len(first) - 2
            if not wrote:
                failed += 1
                print("FAILED %s: %s" % (name, first), flush=True)
                continue
            for kind, command, environment in kinds:
                other = run(command, words, scratch, given, environment)
                if other == first:
                    passed += 1
                else:
                    failed += 1
                    print("DIFFERS %s, %s: %s, %s" % (name, kind, first, other), flush=True)
            inputs.update(kept)
    print("%d files of %d runs, each compared with %d others" % (files, len(jobs), len(kinds)))
    print("%d passed, %d failed" % (passed, failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
