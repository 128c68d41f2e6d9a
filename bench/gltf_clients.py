"""Every glTF file of some folders, remeshed, and opened in the Khronos validator, Blender, Godot and three.js in headless Chromium: a
table in Markdown.

    python3 bench/gltf_clients.py --modules NODE_MODULES [--clients FOLDER] [--quads N] QUADRIG FOLDER...

NODE_MODULES has gltf-validator and three (`npm install gltf-validator three`); FOLDER has check_blender.py and godot_check/run.sh. Debian:
apt-get install --no-install-recommends blender godot3-server chromium nodejs npm. A client that is not there is left out. Seconds are CPU
seconds of the whole command. `./dev gltf` does all of this."""
import argparse
import http.server
import json
import os
import pathlib
import resource
import shutil
import subprocess
import tempfile
import threading

VALIDATE = '''
const validator = require('gltf-validator'), fs = require('fs'), path = require('path');
(async () => {
  for (const file of process.argv.slice(2)) {
    const load = uri => fs.promises.readFile(path.join(path.dirname(file), decodeURIComponent(uri))).then(b => new Uint8Array(b));
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {maxIssues: 0, externalResourceFunction: load});
    console.log(report.issues.numErrors);
  }
})();
'''


def run(command, seconds, **options):
    # Blender takes the Python that is first on the path for its own.
    options["env"] = {**os.environ, **options.get("env", {}), "PATH": "/usr/bin:/bin:" + os.environ["PATH"]}
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=seconds, **options)
        return done.returncode, done.stdout + done.stderr
    except subprocess.TimeoutExpired:
        return -1, "took too long"


def remesh(quadrig, path, out, quads):
    report, obj = out.with_suffix(".json"), out.with_suffix(".obj")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    status, text = run([quadrig, "-q", "remesh", path, "--quads", str(quads), "-o", out, "--quads-out", obj, "--report", report], 600)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not out.exists():
        return {"failed": f"exit code {status}: {text.strip()[-160:]}"}
    figures = json.loads(report.read_text())
    figures["cpu"] = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    checked = run([quadrig, "-q", "stats", obj, "--json"], 120)[1]
    figures["valid"] = json.loads(checked[checked.index("{"):])["meshes"][0]["valid"]
    figures["parts_failed"] = sum(len(surface["failures"]) for surface in figures["surfaces"])
    copy = out.with_name("copy" + path.suffix)
    figures["copied"] = run([quadrig, "-q", "copy", path, copy], 60)[0] == 0 and copy.read_bytes() == path.read_bytes()
    return figures


def three(page, modules, outputs, chromium):
    """What the page says of each file."""
    results, done = {}, threading.Event()
    kinds = {".js": "text/javascript", ".html": "text/html"}

    class Handler(http.server.BaseHTTPRequestHandler):
        def answer(self, body, kind="application/octet-stream"):
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def do_GET(self):
            path = self.path.split("?")[0]
            if path == "/list":
                return self.answer(json.dumps([out.name for out in outputs]).encode(), "application/json")
            if path == "/":
                return self.answer(page.read_bytes(), "text/html")
            root = {"modules": modules, "files": outputs[0].parent}.get(path.split("/")[1])
            file = root / path.split("/", 2)[2] if root else None
            if not file or ".." in path or not file.is_file():
                return self.send_error(404)
            return self.answer(file.read_bytes(), kinds.get(file.suffix, "application/octet-stream"))

        def do_POST(self):
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            if self.path == "/done":
                done.set()
            else:
                results[self.path.split("/")[-1]] = json.loads(body)
            self.answer(b"")

        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = subprocess.Popen(
            [chromium, "--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
             "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
             f"--user-data-dir={profile}", f"http://127.0.0.1:{server.server_port}/"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        done.wait(30 + 30 * len(outputs))
        browser.terminate()
        browser.wait()
    server.shutdown()
    return results


def says(text):
    """What a check of shared clients printed."""
    if "CHECK OK" in text:
        return "yes"
    errors = text.split('"errors"', 1)[-1].split("]")[0] if '"errors"' in text else text.strip()[-80:]
    return "no:" + errors.strip(' :["').replace("\n", " ")[:100]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("quadrig")
    parser.add_argument("folders", nargs="+", type=pathlib.Path)
    parser.add_argument("--quads", type=int, default=4000)
    parser.add_argument("--modules", type=pathlib.Path, required=True)
    parser.add_argument("--clients", type=pathlib.Path, default=pathlib.Path("../shared/judge/clients"))
    arguments = parser.parse_args()
    files = sorted(path for folder in arguments.folders for path in ([folder] if folder.is_file() else folder.rglob("*"))
                   if path.suffix in (".glb", ".gltf"))
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "validate.cjs").write_text(VALIDATE)
        rows = []
        for path in files:
            out = folder / (path.stem + ".glb")
            rows.append((path, out, remesh(arguments.quadrig, path, out, arguments.quads)))
        made = [(out, figures) for _, out, figures in rows if "failed" not in figures]
        chromium = shutil.which("chromium") or shutil.which("chromium-browser")
        seen = three(pathlib.Path(__file__).with_suffix(".html"), arguments.modules, [out for out, _ in made], chromium) if chromium else {}
        print("| file | triangles | skins | joints | quads | shells left (triangles) | irregular | scaled Jacobian, mean / least | valid | copied | "
              "CPU s | errors in / out | Blender | Godot | three.js |\n|" + "---|" * 15)
        for path, out, figures in rows:
            if "failed" in figures:
                print(f"| {path.name} | {figures['failed']} |")
                continue
            errors = [run(["node", folder / "validate.cjs", file], 60, env={"NODE_PATH": str(arguments.modules.resolve())})
                      [1].strip() for file in (path, out)]
            blender = godot = "not run"
            if shutil.which("blender"):
                blender = says(run(["blender", "-b", "--factory-startup", "-noaudio", "--python-exit-code", "1", "--python",
                                    arguments.clients / "check_blender.py", "--", out, "--max-influences", "4"], 180)[1])
            if shutil.which("godot3-server"):
                godot = says(run(["bash", arguments.clients / "godot_check" / "run.sh", out], 300)[1])
            drawn = seen.get(out.name, {"error": "not run"})
            good = drawn.get("skinned") and drawn["finite"] and drawn["moved"] > 1e-6 and drawn["drawn"] and drawn["changed"]
            browser = "yes" if good else "no: " + str(drawn.get("error") or drawn)
            surfaces, shape = figures["surfaces"], figures["scaled_jacobian"]
            print(f"| {path.name} | {figures['input']['faces']} | {len(surfaces)} | {sum(s['joints'] for s in surfaces)} | {figures['quads']} | "
                  f"{sum(s['passed_shells'] for s in surfaces)} ({sum(s['passed_triangles'] for s in surfaces)}) | {figures['irregular']} | "
                  f"{shape['average']:.3f} / {shape['minimum']:.3f} | {'yes' if figures['valid'] and not figures['parts_failed'] else 'no'} | "
                  f"{'yes' if figures['copied'] else 'no'} | {figures['cpu']:.1f} | {errors[0]} / {errors[1]} | {blender} | {godot} | {browser} |", flush=True)


if __name__ == "__main__":
    main()
