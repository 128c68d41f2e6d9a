"""Checks the reports that the command writes against the schema in docs/.

    report_schema.py QUADRIG SCHEMA

Every kind of report: with a rig and without, made weights, an open surface with creases, a glTF file. Each must fit, and
each with a required member taken away must not."""
import json
import pathlib
import subprocess
import sys
import tempfile

try:
    import jsonschema
except ImportError:
    print("skipped: no python module jsonschema (Debian: python3-jsonschema)")
    sys.exit(0)

quadrig, schema_file = sys.argv[1:]
schema = json.loads(pathlib.Path(schema_file).read_text())
jsonschema.Draft202012Validator.check_schema(schema)
validator = jsonschema.Draft202012Validator(schema)

with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)

    def run(*arguments):
        subprocess.run([quadrig, "--quiet", *map(str, arguments)], check=True)

    run("sample", "pear", "--triangles", 2000, "-o", folder)
    (folder / "sheet.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0\nf 1 2 3 4\n")
    pear, rig, weights = folder / "pear.obj", folder / "pear.tgf", folder / "pear.dmat"
    cases = {
        "rigged": [pear, "--rig", rig, "--weights", weights, "--weights-out", folder / "w.dmat"],
        "bound": [pear, "--rig", rig, "--bind", "voxel"],
        "sized": [pear, "--rig", rig, "--weights", weights, "--density", "posed", "--bones", 2],
        "still": [pear],
        "open": [folder / "sheet.obj", "--creases", 30],
    }
    wrong = 0
    for title, arguments in cases.items():
        report_file = folder / f"{title}.json"
        run("remesh", *arguments, "--quads", 300, "-o", folder / f"{title}-quads.obj", "--report", report_file)
        report = json.loads(report_file.read_text())
        for error in validator.iter_errors(report):
            print(f"{title}: {error.json_path}: {error.message}")
            wrong += 1
        for member in schema["required"]:
            if validator.is_valid({key: value for key, value in report.items() if key != member}):
                print(f"{title}: fits without {member}")
                wrong += 1
print(f"{len(cases)} reports, {wrong} faults")
sys.exit(1 if wrong else 0)
