"""The map of the equations in docs/model.md has the procedures of the code; names in comments and documents exist."""

import functools
import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCES = {path.stem: path for path in (ROOT / "src" / "rodyn").rglob("*.f90")}
MAP = (ROOT / "docs" / "model.md").read_text().split("## 7. Where each equation stands")[1]
FOLDER = ROOT / "src" / "rodyn" / "dynamics"
# Of dynamics/ what has no equations of its own: memory, the choice of a kernel, states, hinges that change, and what asks the kernels.
WITHOUT_EQUATIONS = {"accelerations", "fast_eigenvalues", "fastest_rates", "hinge_events", "lane_accelerations", "lane_motion", "lane_scene",
                     "motion", "outboard_chain", "quantities", "workspace"}
KERNELS = {path.stem for path in FOLDER.glob("*.f90")} - WITHOUT_EQUATIONS
KERNELS |= {"bending_matrices", "rod_bending", "rod_constants", "rod_integrals", "three_moments"}
PROCEDURE = re.compile(r"^\s*(?!end\b)(?:[\w()=*, ]+ )?(?:subroutine|function) (\w+)", re.MULTILINE)
USERS = {"equilibrium", "frequencies", "linear_model", "modes", "scene_modes"}  # of equations that others carry
SHAPES = {"rod_integrals.shape_alpha", "rod_integrals.shape_beta", "rod_integrals.shape_bubble", "rod_integrals.curvature_alpha",
          "rod_integrals.curvature_beta"}  # not equations, but what they are integrals of


def split_comment(line):
    """Code and comment of a line of Fortran."""
    quote = ""
    for place, character in enumerate(line):
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        elif character == "!":
            return line[:place], line[place:]
    return line, ""


@functools.cache
def code_and_comments(path):
    """All code of a file, and its comments by line number."""
    parts = [split_comment(line) for line in path.read_text().splitlines()]
    return "\n".join(code for code, _ in parts), {number: comment for number, (_, comment) in enumerate(parts, 1) if comment}


def procedures(module):
    return set(PROCEDURE.findall(code_and_comments(SOURCES[module])[0]))


def public_procedures(module):
    """Procedures of a module that others call by name; to allocate memory is none of them."""
    code = re.sub(r"&\s*\n\s*", "", code_and_comments(SOURCES[module])[0])
    public = {name.strip() for names in re.findall(r"^\s*public :: (.+)$", code, re.MULTILINE) for name in names.split(",")}
    return public & procedures(module) - {"new_joint_recursion"}


@pytest.mark.parametrize("place", sorted(set(re.findall(r"`(\w+\.\w+)`", MAP)) - {"a.f90", "a.b"}))
def test_each_procedure_of_the_map_exists(place):
    module, name = place.split(".")
    assert module in SOURCES and name in procedures(module)


@pytest.mark.parametrize("module", sorted(KERNELS))
def test_each_public_procedure_with_equations_is_in_the_map(module):
    places = {f"{module}.{name}" for name in public_procedures(module)} - SHAPES
    assert sorted(place for place in places if f"`{place}`" not in MAP) == []


def test_each_kernel_says_where_its_equations_stand_as_well():
    heads = {module: code_and_comments(FOLDER / f"{module}.f90")[1] for module in KERNELS if (FOLDER / f"{module}.f90").exists()}
    silent = {module for module, comments in heads.items() if not any("docs/model.md sec. 7" in text for text in comments.values())}
    assert silent == USERS


def fortran():
    return [path for folder in ("src", "app", "bench", "test") for path in (ROOT / folder).rglob("*.[fF]90")]


def test_modules_that_comments_and_documents_name_exist():
    modules = {f"rodyn_{module}" for module in SOURCES}
    scripts = {path.stem for path in (ROOT / "postproc").glob("*.py")}
    in_c = set(re.findall(r"\brodyn_\w+", (ROOT / "src" / "rodyn" / "interface" / "rodyn.h").read_text()))
    others = {"rodyn_x", "rodyn_shared", "rodyn_resultPtrPtr"}
    named = {(path.relative_to(ROOT), name) for path in fortran() for text in code_and_comments(path)[1].values()
             for name in re.findall(r"\brodyn_\w+", text)}
    named |= {(path.relative_to(ROOT), name) for path in [*(ROOT / "docs").glob("*.md"), *ROOT.glob("*.md")]
              for name in re.findall(r"\brodyn_\w+", path.read_text())}
    assert sorted((str(path), name) for path, name in named if name not in modules | scripts | in_c | others) == []


def test_what_comments_put_in_backticks_is_code():
    """`a` and `a%b(c)` name something of the sources, `a_` a family; commands and paths have blanks, slashes or dots."""
    words = {word.lower() for path in fortran() for word in re.findall(r"\w+", code_and_comments(path)[0])}
    wrong = []
    for path in fortran():
        for number, comment in code_and_comments(path)[1].items():
            for name in re.findall(r"`(\w+(?:%\w+)*(?<!_))(?:\(.*?\))?`", comment):
                wrong += [f"{path.relative_to(ROOT)}:{number}: {name}" for word in name.split("%")
                          if word.lower().removesuffix("_i") not in words]
    assert wrong == []
