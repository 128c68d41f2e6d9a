#!/usr/bin/env python3
"""Holds docs/thesis.md against the tree: equations.py PROJECT

Every equation from 3.1 to 4.19 is in its table, and every header, name, picture and figure that it speaks of is there.
"""
import pathlib
import re
import sys


def wanted_equations():
    return [f"3.{k}" for k in range(1, 11)] + [f"4.{k}" for k in range(1, 20)]


def equations_of(cell):
    """"4.2", "4.6 to 4.13"."""
    match = re.fullmatch(r"([34])\.(\d+)(?: to ([34])\.(\d+))?", cell)
    if not match or match[3] not in (None, match[1]):
        return None
    return [f"{match[1]}.{k}" for k in range(int(match[2]), int(match[4] or match[2]) + 1)]


def defines(source, name):
    """Whether a C++ source declares or defines a function, a class or a member of that name (the last part of A::b)."""
    code = re.sub(r"//[^\n]*", "", source)
    parts = [re.escape(part) for part in name.split("::")]
    # What stands before a call is an operator, a bracket or `return`; before a declaration, a type.
    return all(re.search(rf"\b(?:class|struct)\s+{part}\b", code) for part in parts[:-1]) and bool(
        re.search(rf"\b(?:class|struct)\s+{parts[-1]}\b|"
                  rf"[\w>&*\]](?<!return)\s+{parts[-1]}\s*\([^;]*?\)\s*(?:const\s*)?(?:noexcept\s*)?[;{{:]", code, re.S))


def main():
    project = pathlib.Path(sys.argv[1])
    page = (project / "docs/thesis.md").read_text(encoding="utf-8")
    faults, seen = [], []
    for line in page.split("## Equations", 1)[-1].split("\n## ", 1)[0].split("\n"):
        cells = [cell.strip() for cell in line.strip("| ").split("|")]
        numbers = equations_of(cells[0]) if line.startswith("|") else None
        if numbers is None:
            continue
        seen += numbers
        header, names = cells[-2].strip("`"), re.findall(r"`([\w:]+)`", cells[-1])
        file = project / "include/quadrig" / header
        if not file.is_file():
            faults.append(f"{cells[0]}: there is no include/quadrig/{header}")
            continue
        faults += [f"{cells[0]}: {header} defines no {name}" for name in names if not defines(file.read_text(encoding="utf-8"), name)]
        if not names:
            faults.append(f"{cells[0]}: names no function")
    faults += [f"{number} is not in the table" for number in wanted_equations() if number not in seen]
    faults += [f"there is no docs/{target}" for target in re.findall(r"\]\(([\w./-]+)(?:#[\w-]*)?\)", page)
               if not (project / "docs" / target).exists()]
    script = (project / "tests/thesis/figures.py").read_text(encoding="utf-8")
    faults += [f"--only {name} makes no figure" for name in re.findall(r"--only ([a-z]\w*)", page) if f"def {name}(f)" not in script]
    for fault in faults:
        print(fault)
    print(f"{len(seen)} equations, {len(faults)} faults")
    return len(faults) > 0


if __name__ == "__main__":
    sys.exit(main())
