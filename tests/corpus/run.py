#!/usr/bin/env python3
"""Remeshes every surface of some folders at several densities and prints one table.

A surface is an .obj, .off or .ply file; the .tgf and .dmat files beside it are its rig where there is one of each.
Ends with an error where the command crashed, hung, gave a result that its own report calls invalid, or lost a part of
the surface without a warning: a refusal is an answer, a bad mesh is not. `far` is the farthest point of a part from its
quads, in edges of these.
"""

import argparse
import json
import pathlib
import resource
import subprocess
import sys
import tempfile


def cpu_seconds():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def surfaces(folder):
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in (".obj", ".off", ".ply", ".stl"):
            continue
        rigs = sorted(path.parent.glob("*.tgf"))
        weights = sorted(path.parent.glob("*weights*.dmat"))
        rig = (rigs[0], weights[0]) if len(rigs) == 1 and len(weights) == 1 else None
        yield path, rig


def lowest_rung(components):
    order = ["fine-map", "coarse-map", "split"]
    return max((part["rung"] for part in components), key=order.index, default="")


def farthest(figures):
    """Of the parts, in edges of their quads."""
    return max(part["farthest"] / part["edge"] for part in figures["components"])


def remesh(command, path, rig, quads, timeout):
    with tempfile.TemporaryDirectory() as scratch:
        out, report = pathlib.Path(scratch) / "out.obj", pathlib.Path(scratch) / "report.json"
        call = [command, "remesh", path, "--quads", quads, "-o", out, "--report", report, "--quiet"]
        if rig:
            call += ["--rig", rig[0], "--weights", rig[1]]
        before = cpu_seconds()
        try:
            done = subprocess.run([str(word) for word in call], capture_output=True, text=True, timeout=timeout)
        except subprocess.TimeoutExpired:
            return "hung", f"no answer within {timeout} s", None, cpu_seconds() - before
        seconds = cpu_seconds() - before
        if done.returncode < 0:
            return "crashed", f"signal {-done.returncode}", None, seconds
        parts_astray = 9
        if done.returncode not in (0, parts_astray):
            if out.exists():
                return "invalid", "left a mesh behind an error", None, seconds
            reason = done.stderr.strip().splitlines()
            return "refused", reason[-1] if reason else f"exit code {done.returncode}", None, seconds
        figures = json.loads(report.read_text())
        if farthest(figures) > 1.5 and not any(text.startswith("coverage: ") for text in figures["warnings"]):
            return "lossy", "a part is missing, and no warning says so", figures, seconds
        return "valid", "", figures, seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", help="the quadrig executable")
    parser.add_argument("folder", type=pathlib.Path, nargs="+")
    parser.add_argument("--only", default="", help="surfaces whose path contains this")
    parser.add_argument("--quads", default="300,1000,2000,5000,20000", help="densities (default %(default)s)")
    parser.add_argument("--timeout", type=float, default=600, help="seconds for one remesh (default %(default)s)")
    arguments = parser.parse_args()
    for folder in arguments.folder:
        if not folder.is_dir():
            sys.exit(f"{folder} is no folder")

    tally, rungs = {}, {}
    print("| surface | rig | asked | result | quads | irregular | SJ avg | SJ min | far | rung | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for folder, path, rig in ((f, p, r) for f in arguments.folder for p, r in surfaces(f)):
        if arguments.only not in str(path):
            continue
        for quads in (int(word) for word in arguments.quads.split(",")):
            result, reason, figures, seconds = remesh(arguments.command, path, rig, quads, arguments.timeout)
            tally[result] = tally.get(result, 0) + 1
            cells = [path.relative_to(folder), "yes" if rig else "", quads]
            if figures:
                jacobian = figures["scaled_jacobian"]
                rung = lowest_rung(figures["components"])
                rungs[rung] = rungs.get(rung, 0) + 1
                cells += [result, figures["quads"], figures["irregular"]]
                cells += [f"{jacobian['average']:.3f}", f"{jacobian['minimum']:.3f}", f"{farthest(figures):.2f}", rung]
            else:
                cells += [f"{result}: {reason}", "", "", "", "", "", ""]
            cells.append(f"{seconds:.2f}")
            print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)
    for counts in (tally, rungs):
        print(", ".join(f"{count} {name}" for name, count in sorted(counts.items())))
    sys.exit(1 if {"crashed", "hung", "invalid", "lossy"} & tally.keys() or not tally else 0)


if __name__ == "__main__":
    main()
