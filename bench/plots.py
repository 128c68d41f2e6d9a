#!/usr/bin/env python3
"""Plots of what bench_cholesky measured, from its JSON: microseconds a face against faces, one line a backend.

    bench/plots.py build/bench/bench_cholesky.json docs/images pear
"""

import collections
import json
import math
import pathlib
import sys

COLOURS = ["#2f7ed8", "#d8572a", "#3a9d5d", "#8e63ce", "#c9a227", "#12858c", "#b05279", "#5f6368", "#9aa0a6", "#6b4f3a"]
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 760, 380, 60, 250, 34, 46
PLOTS = {
    "first": ("A first solution: ordering, analysis, factorization and solve", ("analyze", "factorize", "solve")),
    "again": ("Once more with new values: factorization and solve", ("factorize", "solve")),
}


def read(path, mesh):
    """{backend: {faces: {verb: microseconds of the processor}}}"""
    found = collections.defaultdict(lambda: collections.defaultdict(dict))
    for run in json.loads(pathlib.Path(path).read_text())["benchmarks"]:
        if run.get("error_occurred") or run.get("run_type") != "iteration":
            continue
        words = run["name"].split("/iterations:")[0].split("/")
        verb, backend, shape, faces = words[0][3:], "/".join(words[1:-2]), words[-2], int(words[-1])
        if shape == mesh:
            scale = {"ns": 1e-3, "us": 1, "ms": 1e3, "s": 1e6}[run["time_unit"]]
            found[backend][faces][verb] = run["cpu_time"] * scale
    return found


def plot(title, verbs, found):
    lines = {}
    for backend, sizes in found.items():
        points = sorted((n, sum(t[v] for v in verbs) / n) for n, t in sizes.items() if all(v in t for v in verbs))
        if len(points) > 1:
            lines[backend] = points
    xs = [x for points in lines.values() for x, _ in points]
    ys = [y for points in lines.values() for _, y in points]
    x0, x1 = math.log10(min(xs)) - 0.05, math.log10(max(xs)) + 0.05
    y0, y1 = math.log10(min(ys)) - 0.1, math.log10(max(ys)) + 0.1

    def at(x, y):
        return (LEFT + (math.log10(x) - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT),
                HEIGHT - BOTTOM - (math.log10(y) - y0) / (y1 - y0) * (HEIGHT - TOP - BOTTOM))

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
           f'font-size="12"><rect width="100%" height="100%" fill="#fff"/>'
           f'<text x="{LEFT}" y="20" font-size="14">{title}, µs of one processor a face</text>']
    for x in sorted(set(xs)):
        px, _ = at(x, 10**y0)
        label = f"{x / 1e6:.2f}M" if x >= 1e6 else f"{x / 1e3:.0f}k"
        out.append(f'<line x1="{px:.1f}" y1="{TOP}" x2="{px:.1f}" y2="{HEIGHT - BOTTOM}" stroke="#eee"/>'
                   f'<text x="{px:.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{label}</text>')
    for y in [m * 10.0**e for e in range(-2, 4) for m in (1, 2, 5)]:
        if y0 <= math.log10(y) <= y1:
            _, py = at(10**x0, y)
            out.append(f'<line x1="{LEFT}" y1="{py:.1f}" x2="{WIDTH - RIGHT}" y2="{py:.1f}" stroke="#eee"/>'
                       f'<text x="{LEFT - 6}" y="{py + 4:.1f}" text-anchor="end">{y:g}</text>')
    out.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 8}" text-anchor="middle">faces</text>')
    for k, (backend, points) in enumerate(sorted(lines.items(), key=lambda each: -each[1][-1][1])):
        colour = COLOURS[k % len(COLOURS)]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in (at(*point) for point in points))
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>'
                   f'<rect x="{WIDTH - RIGHT + 14}" y="{TOP + 20 * k}" width="12" height="12" fill="{colour}"/>'
                   f'<text x="{WIDTH - RIGHT + 32}" y="{TOP + 20 * k + 10}">{backend}</text>')
    return "\n".join(out) + "\n</svg>\n"


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    found = read(sys.argv[1], sys.argv[3])
    folder = pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for name, (title, verbs) in PLOTS.items():
        (folder / f"solvers-{name}.svg").write_text(plot(title, verbs, found))


if __name__ == "__main__":
    main()
