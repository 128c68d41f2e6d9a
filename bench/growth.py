#!/usr/bin/env python3
"""Time and memory of one remesh against the number of triangles, by stage, as a table and a plot.

    bench/growth.py build/release/quadrig docs/images/growth.svg [--sample humanoid] [--quads 4000]

Samples are made by `quadrig sample`; one thread, user and system time of the whole process, largest resident memory.
"""

import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time

STAGES = ["read", "metric", "pieces", "field", "map", "integers", "extraction", "polish", "transfer"]
COLOURS = ["#9aa0a6", "#8e63ce", "#5c6670", "#2f7ed8", "#d8572a", "#c9a227", "#3a9d5d", "#12858c", "#b05279"]


def run(call):
    """Runs a command; returns its processor seconds and largest resident memory in bytes."""
    started = time.monotonic()
    child = subprocess.Popen([str(word) for word in call], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if status != 0:
        sys.exit(f"failed: {' '.join(str(word) for word in call)}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024, time.monotonic() - started


def measure(command, sample, triangles, quads, folder):
    run([command, "sample", sample, "-o", folder, "--triangles", triangles])
    mesh, report = folder / f"{sample}.obj", folder / "report.json"
    call = [command, "remesh", mesh, "--rig", mesh.with_suffix(".tgf"), "--weights", mesh.with_suffix(".dmat")]
    call += ["--quads", quads, "--threads", 1, "-o", folder / "quads.obj", "--report", report, "--quiet"]
    cpu, memory, wall = run(call)
    figures = json.loads(report.read_text())
    # Stages are timed by the clock: where others use the machine as well, each gets its share of the processor's time.
    stages = {stage: seconds * min(1.0, cpu / wall) for stage, seconds in figures["seconds"].items()}
    return {"faces": figures["input"]["faces"], "cpu": cpu, "memory": memory, **stages}


def plot(rows, title):
    """Two logarithmic axes; a dotted line of slope one for comparison."""
    width, height, left, right, top, bottom = 760, 480, 64, 150, 40, 52
    low_x, high_x = (math.log10(f(row["faces"] for row in rows)) for f in (min, max))
    shown = [row[stage] for row in rows for stage in STAGES if row[stage] > 0] + [row["cpu"] for row in rows]
    low_y, high_y = math.floor(math.log10(max(min(shown), 1e-3))), math.ceil(math.log10(max(shown)))

    def at(x, y):
        u = (math.log10(x) - low_x) / max(high_x - low_x, 1e-9)
        v = (math.log10(max(y, 10.0**low_y)) - low_y) / (high_y - low_y)
        return left + u * (width - left - right), height - bottom - v * (height - top - bottom)

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
           'font-size="12">', f'<rect width="{width}" height="{height}" fill="white"/>',
           f'<text x="{left}" y="22" font-size="14">{title}</text>']
    for power in range(low_y, high_y + 1):
        _, y = at(rows[0]["faces"], 10.0**power)
        out.append(f'<line x1="{left}" x2="{width - right}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dddddd"/>')
        out.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{10.0**power:g} s</text>')
    for row in rows:
        x, _ = at(row["faces"], 1)
        name = f"{row['faces'] / 1e6:.3g}M" if row["faces"] >= 1e6 else f"{row['faces'] / 1e3:.3g}k"
        out.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{height - bottom}" stroke="#eeeeee"/>')
        out.append(f'<text x="{x:.1f}" y="{height - bottom + 18}" text-anchor="middle">{name}</text>')
    out.append(f'<text x="{(left + width - right) / 2}" y="{height - 12}" text-anchor="middle">triangles</text>')

    def line(values, colour, name, extra='stroke-width="1.8"'):
        points = [at(row["faces"], value) for row, value in zip(rows, values)]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" {extra}/>')
        return points[-1][1], name, colour

    labels = [line([row["cpu"] for row in rows], "#000000", "whole", 'stroke-width="3"')]
    first = rows[0]
    labels.append(line([first["cpu"] * row["faces"] / first["faces"] for row in rows], "#888888", "linear",
                       'stroke-width="1.8" stroke-dasharray="2 4"'))
    for stage, colour in zip(STAGES, COLOURS):
        if max(row[stage] for row in rows) > 10.0**low_y:
            labels.append(line([row[stage] for row in rows], colour, stage))
    y = -math.inf
    for wanted, name, colour in sorted(labels):
        y = max(wanted, y + 14)
        out.append(f'<text x="{width - right + 8}" y="{y + 4:.1f}" fill="{colour}">{name}</text>')
    return "\n".join(out + ["</svg>", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", help="the quadrig executable")
    parser.add_argument("plot", type=pathlib.Path, help="where the plot goes, .svg")
    parser.add_argument("--sample", default="humanoid")
    parser.add_argument("--quads", type=int, default=4000)
    parser.add_argument("--triangles", default="5000,15000,50000,150000,400000,1000000")
    arguments = parser.parse_args()
    rows = []
    print("| triangles | " + " | ".join(STAGES) + " | whole, CPU s | memory, MB | bytes a triangle |")
    print("|---" * (len(STAGES) + 4) + "|")
    with tempfile.TemporaryDirectory() as scratch:
        for count in (int(word) for word in arguments.triangles.split(",")):
            row = measure(arguments.command, arguments.sample, count, arguments.quads, pathlib.Path(scratch) / "sample")
            rows.append(row)
            cells = [str(row["faces"])] + [f"{row[stage]:.2f}" for stage in STAGES]
            cells += [f"{row['cpu']:.1f}", f"{row['memory'] / 1e6:.0f}", f"{row['memory'] / row['faces']:.0f}"]
            print("| " + " | ".join(cells) + " |", flush=True)
    arguments.plot.write_text(plot(rows, f"{arguments.sample}, {arguments.quads} quads, one thread"))


if __name__ == "__main__":
    main()
