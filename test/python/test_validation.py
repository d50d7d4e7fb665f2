"""The quick part of bench/validation: of each family a scene with 8 and with 16 rods, whose errors fall as they should; exact scenes."""

import pathlib
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench" / "validation"))

import benchmarks  # noqa: E402
import references  # noqa: E402
import run  # noqa: E402

LONG = {"spin_up", "flying_beam"}  # integrated for seconds
RODS = (8, 16)
CONVERGING = list({b.case: b for b in reversed(benchmarks.BENCHMARKS) if not b.exact and b.case not in LONG}.values())
EXACT = [b for b in benchmarks.BENCHMARKS if b.exact]


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    return benchmarks.Program(tmp_path_factory.mktemp("validation"))


@pytest.mark.parametrize("benchmark", CONVERGING, ids=lambda b: b.case)
def test_errors_fall_with_the_order_of_the_rods(program, benchmark):
    for model, values in run.compute(benchmark, program, RODS).items():
        wrong = run.errors(benchmark.quantities[0], [row[0] for row in values])
        order = np.log2(np.abs(wrong[0] / wrong[1]))
        least = 0.9 * (4.0 if model == "inextensible" else benchmark.order)
        assert order > least or np.abs(wrong).max() < run.ROUNDING, f"{model}: errors {wrong}, order {order:.2f}"


@pytest.mark.parametrize("n", [1, 2, 4])
def test_rods_that_keep_their_arc_are_finite_elements_with_geometric_stiffness(program, n):
    for benchmark in benchmarks.BENCHMARKS:
        if benchmark.case == "blade":
            (found,) = benchmark.measure(program, benchmarks.Scene("blade", n, "inextensible", benchmark.numbers))
            elements = references.blade_elements(benchmark.numbers["omega"], benchmark.numbers["radius"], n)
            assert abs(found / elements - 1.0) < 1e-9, benchmark.quantities[0].name


@pytest.mark.parametrize("benchmark", EXACT, ids=run.key)
def test_exact_scenes_agree_to_rounding(program, benchmark):
    (found,) = run.compute(benchmark, program).values()
    for values in found:
        for quantity, value in zip(benchmark.quantities, values, strict=True):
            # 100 rtol of runs; what the printed digits leave open
            assert abs(value - quantity.reference) < max(1e-11, quantity.floor), quantity.name


def test_each_family_names_its_source_and_stands_in_the_document():
    document = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
    files = {path.stem for path in (ROOT / "bench" / "validation").glob("*.nml")}
    assert files == {b.case for b in benchmarks.BENCHMARKS}
    for case in files:
        title, text = run.header(case)
        assert "\n\nSource" in text
        assert f"### {title}\n" in document
