"""Print what each file of a build is made from, for ninja (tools/compile).

    python tools/write_ninja.py STAGE COMPILER FLAGS LIBRARIES

A file is compiled after those whose modules it uses. gfortran leaves a module file alone if what the module offers is still the
same; then nothing that uses it is compiled again. Folders whose code takes no time are optimised less, and the code of tests is not:
that would take longer than to run it.
"""

from __future__ import annotations

import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
MODULE = re.compile(r"^ *module +(?!procedure\b|subroutine\b|function\b)(\w+)", re.MULTILINE | re.IGNORECASE)
USE = re.compile(r"^ *use\b(?: *, *non_intrinsic)?[ :]*(\w+)", re.MULTILINE | re.IGNORECASE)
INCLUDE = re.compile(r"^ *include '(.*)'", re.MULTILINE)
RULES = """\
builddir = {stage}
rule compile
  command = {compiler} {flags} $more -I{stage}/include -J$modules -c $in -o $out
  description = $in
  restat = 1
rule compile_c
  command = {compiler} -O2 -c $in -o $out
  description = $in
rule archive
  command = rm -f $out && ar rcs $out $in
  description = $out
rule share
  command = {compiler} {flags} -shared -o $out $in -Wl,--version-script=app/shared.map -Wl,-z,defs -Wl,--as-needed {libraries}
  description = $out
rule link
  command = {compiler} {flags} -o $out $in {libraries}
  description = $out
"""
LESS = {("src", "rodyn", folder): "-O1" for folder in ("input", "output", "sweep", "program", "interface")}
STAMPED = {"app": "-DRODYN_STAMPED"}  # includes what tools/stamp_commit wrote
PROGRAMS = {"app/main.F90": "bin/rodyn", "test/main.f90": "test/tester", "test/sample_run.f90": "test/sample_run"}
SHARED = ("app/shared.F90", "src/rodyn/interface/c_interface.f90") # what else it needs comes from the archive
ARCHIVES = {"src": "lib/librodyn.a", "test": "objects/libtest.a"}


def main() -> None:
    """Read the source files, and print."""
    stage, compiler, flags, libraries = sys.argv[1:]
    if "--enable-default-pie" not in subprocess.run([compiler, "-v"], capture_output=True, text=True).stderr:
        flags += " -fPIE" # or the shared library could not be made from the same objects
    print(RULES.format(stage=stage, compiler=compiler, flags=flags, libraries=libraries))
    paths = [path for pattern in ("src/**/*.[fF]90", "app/*.F90", "test/*.f90") for path in sorted(ROOT.glob(pattern))]
    texts = {path.relative_to(ROOT): path.read_text() for path in paths}
    modules_of = {"src": f"{stage}/include", "app": f"{stage}/include", "test": f"{stage}/objects"}
    module_file = {name: f"{modules_of[path.parts[0]]}/{name}.mod" for path, text in texts.items() for name in MODULE.findall(text)}
    members: dict[str, list[str]] = {folder: [] for folder in ARCHIVES}
    in_c = {f"{stage}/objects/app_{path.name}.o": path.name for path in sorted(ROOT.glob("app/*.c"))}
    for made, name in in_c.items():
        print(f"build {made}: compile_c app/{name}")
    for path, text in texts.items():
        folder = path.parts[0]
        made = f"{stage}/objects/{'_'.join(path.parts)}.o"
        offered = [module_file[name] for name in MODULE.findall(text)]
        needed = [module_file[name] for name in sorted(set(USE.findall(text))) if name in module_file]
        needed += [str(path.parent / name) for name in INCLUDE.findall(text)]
        print(f"build {made}{' | ' * bool(offered)}{' '.join(offered)}: compile {path} | {' '.join(needed)}")
        print(f"  modules = {modules_of[folder]}")
        less = "-O0" if folder == "test" else LESS.get(path.parts[:3], "") if "-O3" in flags else ""
        print("  more =", less, STAMPED.get(folder, ""))
        if str(path) in PROGRAMS:
            parts = [made, *in_c] if folder == "app" else [made, f"{stage}/{ARCHIVES['test']}"]
            print(f"build {stage}/{PROGRAMS[str(path)]}: link {' '.join(parts)} {stage}/{ARCHIVES['src']}")
        elif folder != "app":
            members[folder].append(made)
    shared = " ".join(f"{stage}/objects/{path.replace('/', '_')}.o" for path in SHARED)
    archive = f"{stage}/{ARCHIVES['src']}"
    print(f"build {stage}/lib/librodyn.so: share {shared} {archive} | app/shared.map")
    for folder, objects in members.items():
        print(f"build {stage}/{ARCHIVES[folder]}: archive {' '.join(objects)}")


main()
