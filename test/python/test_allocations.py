"""The right-hand side and the loop of steps allocate nothing.

A small library, compiled here and preloaded, counts the calls of malloc and its kin in a whole run. Of two runs with the
same number of rows, one twice as long, the second makes about twice as many steps: what it allocates more, steps allocate.

RODYN=path  the program under test; otherwise bin/rodyn.
"""

import os
import pathlib
import shutil
import subprocess
import sys

import h5py
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
RODYN = os.environ.get("RODYN", str(ROOT / "bin" / "rodyn"))

# Allocations by which the longer run may exceed the shorter one, whatever the number of steps. The loop itself makes none;
# the rest is what does not repeat from run to run: a text of other length (t_end in `resolved_input`, counts printed with
# more digits), and the compressed rows, whose number of bytes depends on their values.
TOLERANCE = 40

# The number of modes that `gauss` takes for stiff changes a few times in a run, with up to some thirty arrays each time.
CHANGES_OF_MODES = 40

# Jacobians may allocate: about ten work arrays for each of their columns (8 to 9 n were counted for n states). CVODE asks for
# a new one every 40 to 60 steps. The first bound says that nothing but Jacobians allocates, the second what that comes to per step.
PER_JACOBIAN_AND_STATE = 12
BDF_PER_STEP = 5

COUNTER = r"""
#define _GNU_SOURCE
#include <errno.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
static atomic_long calls;
void *malloc(size_t size) { calls++; return __libc_malloc(size); }
void *calloc(size_t n, size_t size) { calls++; return __libc_calloc(n, size); }
void *realloc(void *old, size_t size) { calls++; return __libc_realloc(old, size); }
void *aligned_alloc(size_t alignment, size_t size) { calls++; return __libc_memalign(alignment, size); }
void *memalign(size_t alignment, size_t size) { calls++; return __libc_memalign(alignment, size); }
int posix_memalign(void **result, size_t alignment, size_t size) {
   calls++;
   *result = __libc_memalign(alignment, size);
   return *result ? 0 : ENOMEM;
}
__attribute__((destructor)) static void report(void) {
   const char *path = getenv("ALLOCATIONS");
   FILE *file = path ? fopen(path, "w") : NULL;
   if (!file) return;
   fprintf(file, "%ld\n", (long)calls);
   fclose(file);
}
"""

SCENES = {
    # Dampers, a kink, a load that varies on a node; with a ledger, whose integrals have a control of their own.
    "flexible": ("dynamic", "distributed", "hinge_damping = 0.02, kink = 0, 0.05, 0"),
    "three shapes": ("dynamic", "distributed", "hinge_damping = 0.02, kink = 0, 0.05, 0"),
    "strong dampers": ("dynamic", "distributed", "hinge_damping = 20"), # couple the modes of gauss
    "rigid": ("rigid", "distributed", "hinge_damping = 0.02, kink = 0, 0.05, 0"),
    "lumped": ("rigid", "lumped", "hinge_damping = 0.02"),
    "quasistatic": ("quasistatic", "lumped", "hinge_damping = 0.02, kink = 0, 0.05, 0"),
    "condensed": ("quasistatic", "distributed", "hinge_damping = 0.02, kink = 0, 0.05, 0"),
    "exact dampers": ("quasistatic", "lumped", "hinge_damping = 0, 20, 20, kink = 0, 0.05, 0"),
}
# The assembled kernel is a check of condensed rods and forms T^T M T as it stands.
WAYS = [(scene, kernel) for scene in SCENES for kernel in ("recursive", "assembled") if (scene, kernel) != ("condensed", "assembled")]


def case(scene: str, motion: str, kernel: str, method: str, t_end: float) -> str:
    bending, inertia, hinges = SCENES[scene]
    shapes = {"three shapes": "bending_shapes = 3, gauss_points = 5,", "condensed": "formulation = 'consistent',"}.get(scene, "")
    return f"""&case t_end = {t_end:.2f}, n_outputs = 1 /
&spacecraft motion = '{motion}', mass = 122.5, inertia = 10, hinge_x = 0.35, hinge_y = 0.35 /
&chain n_rods = 3, length = 1.5, 1.4, 1.3, mass_per_length = 1.7, bending_stiffness = 1.37e4, node_mass = 0.5,
   hinge_stiffness = 6000, 2*4000, {hinges} /
&model bending = '{bending}', inertia = '{inertia}', kernel = '{kernel}', {shapes}
   dampers = '{"exact" if scene.startswith("exact") else "reduced"}' /
&load component = 'M', value = 1500, t_end = 0.05 /
&load target = 'node', node = 2, component = 'Y', law = 'sine_squared', value = 50, rate = 40 /
&solver method = '{method}', max_step = 1e-3 /
"""


@pytest.fixture(scope="module")
def counter(tmp_path_factory) -> pathlib.Path:
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None or not sys.platform.startswith("linux") or "musl" in str(sorted(pathlib.Path("/lib").glob("ld-*"))):
        pytest.skip("needs a C compiler and glibc")
    directory = tmp_path_factory.mktemp("counter")
    (directory / "counter.c").write_text(COUNTER)
    library = directory / "counter.so"
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", library, directory / "counter.c"], check=True)
    return library


def count(counter: pathlib.Path, directory: pathlib.Path, text: str) -> tuple[int, int, int, int]:
    """Allocations, steps, right-hand sides and Jacobians of a run."""
    (directory / "case.nml").write_text(text)
    environment = {**os.environ, "LD_PRELOAD": str(counter), "ALLOCATIONS": str(directory / "calls"),
                   "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([RODYN, "run", "case.nml", "--force", "--quiet"], cwd=directory, env=environment, check=True)
    with h5py.File(directory / "case.h5") as file:
        solver = file["solver"].attrs
        return int((directory / "calls").read_text()), int(solver["n_steps"]), int(solver["n_rhs"]), int(solver["n_jac"])


def growth(counter, directory, *what) -> tuple[int, int, int]:
    """Allocations, steps and Jacobians by which a run of twice the time exceeds the other."""
    t_end = {"strong dampers": 0.6, "three shapes": 0.1}.get(what[0], 0.3)  # the first take more steps at first, the others always
    short = count(counter, directory, case(*what, t_end))
    long = count(counter, directory, case(*what, 2*t_end))
    assert short[0] > 100  # the counter counts
    assert min(long[1] - short[1], long[2] - short[2]) > 5*TOLERANCE  # one in each would be seen
    return long[0] - short[0], long[1] - short[1], long[3] - short[3]


# The steps know nothing of the kernel: each method with the recursive one, and each kernel by one method.
@pytest.mark.parametrize(("scene", "kernel", "method"), [
    (*way, method) for way in WAYS for method in (["adams", "erk", "dop853", "gauss"] if way[1] == "recursive" else ["dop853"])
])
def test_steps_allocate_nothing(counter, tmp_path, scene, method, kernel):
    if method == "gauss" and scene == "exact dampers":
        method = "dop853"  # which gauss refuses
    allocations, _, _ = growth(counter, tmp_path, scene, "free", kernel, method)
    assert abs(allocations) <= TOLERANCE + (CHANGES_OF_MODES if method == "gauss" else 0)


@pytest.mark.parametrize(("scene", "kernel"), WAYS)
def test_steps_allocate_nothing_on_a_fixed_spacecraft(counter, tmp_path, scene, kernel):
    allocations, _, _ = growth(counter, tmp_path, scene, "fixed", kernel, "dop853")
    assert abs(allocations) <= TOLERANCE


@pytest.mark.parametrize("kernel", ["recursive", "assembled"])
@pytest.mark.parametrize("scene", ["flexible", "quasistatic"])
def test_implicit_steps_allocate_for_jacobians_only(counter, tmp_path, scene, kernel):
    allocations, steps, jacobians = growth(counter, tmp_path, scene, "free", kernel, "bdf")
    states = 24 if scene == "flexible" else 12
    assert allocations <= PER_JACOBIAN_AND_STATE*states*jacobians + TOLERANCE
    assert allocations <= BDF_PER_STEP*steps
