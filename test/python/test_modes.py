"""rodyn modes: what is in its file, that the matrices and eigenvalues belong together, and its pictures.

RODYN=path  the program under test; otherwise bin/rodyn.
"""

import pathlib

import equilibria
import mode_shapes
import numpy as np
import pytest
import result_files
import xarray
from rodyn_data import DataError
from scripts import answer, script
from test_command_line import DAMPED, FIXED, KINKED, SCENES, SPACECRAFT, rodyn, write_case

TEXTS = ["title", "status", "program_version", "git_commit", "compiler", "input", "resolved_input", "notes", "at"]


def modes_of(directory: pathlib.Path, text: str, *options: str) -> xarray.Dataset:
    write_case(directory, text)
    result = rodyn("modes", "case.nml", "--output", "case_modes.h5", "--force", *options, cwd=directory)
    assert result.returncode == 0, result.stderr
    return result_files.read(directory / "case_modes.h5")


@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_has_a_file_that_explains_itself(scene, tmp_path, request):
    data = modes_of(tmp_path, SCENES[scene])
    if scene in ("flexible", "one rigid rod, fixed") or request.config.getoption("--all"):  # which takes most of the time
        xarray.testing.assert_identical(data, xarray.load_dataset(tmp_path / "case_modes.h5"))
    for name, variable in data.variables.items():
        assert "long_name" in variable.attrs, name
        assert "units" in variable.attrs or variable.dtype.kind in "OUT", name
    assert all(isinstance(data.attrs[name], str) for name in TEXTS)
    assert data.attrs["status"] == "done" and data.attrs["at"] == "initial state"
    assert data.phi_real.dims == ("mode", "rod") and data.rotation_imag.dims == ("mode",)
    assert data.mass_matrix.dims == ("equation", "rate") and data.stiffness_matrix.dims == ("equation", "coordinate")
    np.testing.assert_allclose(data.frequency, np.hypot(data.frequency_damped, data.decay), rtol=1e-14)
    assert list(data.kind.values).count("rigid body") == (0 if "motion = 'fixed'" in SCENES[scene] else 3)
    oscillations = data.frequency.values[data.kind.values == "oscillation"]
    assert oscillations.size and np.all(np.diff(oscillations) >= 0)


@pytest.mark.parametrize("spin", [0, 2])
def test_frequencies_are_those_of_the_matrices(tmp_path, spin):
    """The pencil of the matrices in the file, by numpy; velocity and place of the spacecraft add zeros and +-i spin."""
    data = modes_of(tmp_path, SPACECRAFT + DAMPED + f"&initial omega = {spin} /\n", "--equilibrium")
    mass, stiffness = data.mass_matrix.values, data.stiffness_matrix.values
    damping = data.damping_matrix.values + data.gyroscopic_matrix.values
    n = mass.shape[0]
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]])
    matrix[0, 1], matrix[1, 0] = spin, -spin
    found = np.linalg.eigvals(matrix)
    for decay, frequency, kind in zip(data.decay.values, data.frequency_damped.values, data.kind.values, strict=True):
        if kind == "oscillation":
            assert np.abs(found - (-decay + 1j * frequency)).min() < 1e-7
    assert data.attrs["stable"] == 1 and data.attrs["steady"] == 1


def test_the_damping_matrix_is_that_of_the_dampers(tmp_path):
    with_dampers = modes_of(tmp_path, FIXED + DAMPED)
    without = modes_of(tmp_path, FIXED + DAMPED.replace(", hinge_damping = 0.02", ""))
    assert np.abs(with_dampers.damping_matrix).max() > 0 and not without.damping_matrix.any()
    assert without.attrs["conservative"] == 1 and with_dampers.attrs["conservative"] == 0
    assert not np.abs(without.phi_imag).any()
    # First order of perturbation: 2 zeta omega = x^T D x of a shape with x^T M x = 1.
    shapes = np.concatenate([without.phi_real, without.alpha_real, without.beta_real], axis=1)
    np.testing.assert_allclose(np.einsum("mi,ij,mj->m", shapes, without.mass_matrix, shapes), 1, rtol=1e-9)
    expected = np.einsum("mi,ij,mj->m", shapes, with_dampers.damping_matrix, shapes) / 2
    np.testing.assert_allclose(with_dampers.decay, expected, rtol=1e-6)


ONE_ROD = """&spacecraft motion = 'fixed' /
&chain n_rods = 1, length = 1.4, mass_per_length = 1.3, bending_stiffness = 700, node_mass = 0.2, hinge_stiffness = 300 /
&rod_profile quantity = 'mass_per_length', polynomial = 1, -0.5, 0.8 /
&rod_profile quantity = 'bending_stiffness', positions = 0, 0.3, 0.3, 1, values = 2, 1, 0.6, 0.2 /
&model bending_shapes = 3, gauss_points = 5 /
"""


def test_a_bubble_on_a_profiled_rod_has_the_matrices_of_quadrature(tmp_path):
    """int m fi fj and int EI fi'' fj'' over s, Na, Nb, Nc by numpy's polynomials, on each piece of the table."""
    data = modes_of(tmp_path, ONE_ROD)
    length, power = 1.4, np.polynomial.Polynomial
    x = power([0, 1])  # s/l
    shapes = [length * x, length * x * (1 - x) ** 2, -length * x**2 * (1 - x), 16 * x**2 * (1 - x) ** 2]
    density = 1.3 * (1 - 0.5 * x + 0.8 * x**2)
    pieces = [(0, 0.3, 700 * (2 - x / 0.3)), (0.3, 1, 700 * (0.6 - 0.4 * (x - 0.3) / 0.7))]

    def integral(f, first, last):
        return length * (f.integ()(last) - f.integ()(first))

    mass = np.array([[integral(density * f * g, 0, 1) for g in shapes] for f in shapes])
    mass[0, 0] += 0.2 * length**2
    stiffness = np.array([[sum(integral(bend * f.deriv(2) * g.deriv(2), a, b) for a, b, bend in pieces) / length**4 for g in shapes]
                          for f in shapes])
    stiffness[:2, :2] += 300
    order = ["phi", "alpha", "beta", "bubble"]
    rates, places = [f"{name}_rate_1" for name in order], [f"{name}_1" for name in order]
    np.testing.assert_allclose(data.mass_matrix.sel(equation=rates, rate=rates), mass, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(data.stiffness_matrix.sel(equation=rates, coordinate=places), stiffness, rtol=1e-12, atol=1e-9)
    expected = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real))
    np.testing.assert_allclose(data.frequency, expected, rtol=1e-9)
    found = np.concatenate([data[f"{name}_real"].values for name in order], axis=1)
    np.testing.assert_allclose(found @ mass @ found.T, np.eye(4), atol=1e-9)
    np.testing.assert_allclose(found @ stiffness @ found.T, np.diag(expected**2), atol=1e-9 * expected[-1] ** 2)
    assert data.bubble_real.units == "m" and data.bubble_real.dims == ("mode", "rod")


HELD = """&spacecraft mass = 30, inertia = 9, hinge_x = 0.4 /
&chain n_rods = 3, length = 1, mass_per_length = 1.5, bending_stiffness = 900, hinge_stiffness = 40, node_mass = 0.1 /
&model bending_shapes = 3, gauss_points = 6 /
&initial phi = 0, 0.5, 0.5 /
&hinge hinge = 1, held = .true., release_time = 0.1, rest_angle = 0.5 /
"""


def test_a_held_hinge_is_no_unknown(tmp_path):
    data = modes_of(tmp_path, HELD)
    names = list(data.coordinate.values)
    assert "phi_2" not in names and "phi_rate_2" not in data.equation.values and len(names) == 3 + 3 * 4 - 1
    assert list(data.kind.values).count("oscillation") == 11
    opening = data.phi_real[:, 1] + data.alpha_real[:, 1] - data.phi_real[:, 0] - data.beta_real[:, 0]
    np.testing.assert_allclose(opening, 0, atol=1e-12 * np.abs(data.alpha_real).max())
    np.testing.assert_allclose(data.state.sel(coordinate=["phi_1", "phi_3"]), [0, 0.5])
    free = modes_of(tmp_path, HELD.replace("held = .true., release_time = 0.1, ", ""))
    assert "phi_2" in free.coordinate.values and free.sizes["mode"] == data.sizes["mode"] + 1
    oscillations = [one.frequency.values[one.kind.values == "oscillation"] for one in (free, data)]
    # Rayleigh: a constraint raises frequencies, each at most to the next one (both states are the same).
    assert np.all(oscillations[1] >= oscillations[0][:-1] * (1 - 1e-12)) and np.all(oscillations[1] <= oscillations[0][1:] * (1 + 1e-12))


def test_kinks_fold_the_equilibrium(tmp_path):
    data = modes_of(tmp_path, SPACECRAFT + KINKED, "--equilibrium")
    state = data.state.sel(coordinate=["phi_1", "phi_2", "phi_3"])
    np.testing.assert_allclose(state, [0, 0.05, 0.05], atol=1e-12)
    assert data.attrs["at"] == "equilibrium"


def test_modes_about_each_state_have_a_file_of_their_own(tmp_path):
    write_case(tmp_path, SPACECRAFT + KINKED)
    for options in ([], ["--equilibrium"], ["--loads"]):
        result = rodyn("modes", "case.nml", *options, cwd=tmp_path)
        assert result.returncode == 0, result.stderr
    assert {path.name for path in tmp_path.glob("*.h5")} == {f"case_modes{state}.h5" for state in ("", "_equilibrium", "_loads")}


def test_where_there_is_no_equilibrium_that_is_said(tmp_path):
    write_case(tmp_path, SCENES["no ledger"])
    result = rodyn("modes", "case.nml", "--equilibrium", cwd=tmp_path)
    assert result.returncode == 1 and "give the spacecraft an angular acceleration" in result.stderr
    assert not list(tmp_path.glob("*.h5"))
    write_case(tmp_path, FIXED + KINKED + "&load target = 'node', node = 1, component = 'Y', law = 'sine_squared', value = 1, rate = 1 /\n")
    result = rodyn("modes", "case.nml", "--equilibrium", cwd=tmp_path)
    assert result.returncode == 1 and "a load or a kink varies in time" in result.stderr


@pytest.mark.parametrize("spacecraft", [SPACECRAFT, FIXED])
@pytest.mark.parametrize("stiffness", ["0", "100, 0"])
def test_free_links_at_rest_are_an_equilibrium(spacecraft, stiffness, tmp_path):
    """Whatever stiffness is missing: the forces are zero."""
    links = f"&chain n_rods = 2, length = 1, mass_per_length = 1, hinge_stiffness = {stiffness} /\n&model bending = 'rigid' /\n"
    data = modes_of(tmp_path, spacecraft + links, "--equilibrium")
    assert data.attrs["at"] == "equilibrium" and abs(data.state).max() == 0


def test_loads_act_on_request(tmp_path):
    plain = modes_of(tmp_path, SCENES["no ledger"])
    loaded = modes_of(tmp_path, SCENES["no ledger"], "--loads")
    assert list(loaded.kind.values).count("rigid body") == 3 and loaded.attrs["steady"] == 0
    assert abs(loaded.frequency.values[3] / plain.frequency.values[3] - 1) > 0.01


def test_modes_behave_as_a_command(tmp_path):
    write_case(tmp_path, FIXED + KINKED)
    first = rodyn("modes", "case.nml", "--output", "m.h5", cwd=tmp_path)
    assert first.returncode == 0 and "oscillation" in first.stdout and first.stdout.endswith("file    m.h5\n")
    assert "exists already" in rodyn("modes", "case.nml", "--output", "m.h5", cwd=tmp_path).stderr
    assert rodyn("modes", "case.nml", "--output", "case.nml", "--force", cwd=tmp_path).returncode == 2
    assert rodyn("run", "case.nml", "--equilibrium", cwd=tmp_path).returncode == 2
    assert rodyn("modes", "case.nml", "--quiet", "--force", cwd=tmp_path).stdout == ""
    assert "--equilibrium" in rodyn("modes", "--help").stdout and "rodyn modes" in rodyn("--help").stdout


@pytest.mark.parametrize("n", [60, pytest.param(200, marks=pytest.mark.long)])
def test_many_rods_take_seconds(tmp_path, n):
    chain = DAMPED.replace("n_rods = 3, length = 1.5, 1.4, 1.3", f"n_rods = {n}, length = 1.5").replace("6000, 2*4000", "4000")
    data = modes_of(tmp_path, SPACECRAFT + chain)
    assert data.sizes["equation"] == 3 * n + 3 and list(data.kind.values).count("oscillation") == 3 * n
    assert np.all(data.damping_ratio[3:] > 0)


@pytest.mark.parametrize(("scene", "options"), [
    (SCENES["flexible"], []), (SCENES["flexible"], ["--modes", "4", "5", "--frame", "moving", "--amplitude", "0.3"]), (HELD, []),
    (ONE_ROD, [])])
def test_shapes_are_drawn(tmp_path, scene, options):
    modes_of(tmp_path, scene)
    command = script if options else answer
    result = command("mode_shapes", tmp_path / "case_modes.h5", "--out", tmp_path / "m.png", *options)
    assert result.returncode == 0 and (tmp_path / "m.png").stat().st_size > 10000, result.stderr


def test_the_picture_swings_as_far_as_it_is_told(tmp_path):
    modes_of(tmp_path, SCENES["flexible"])
    with mode_shapes.open_modes(tmp_path / "case_modes.h5") as found:
        still, ahead, behind, *_ = mode_shapes.swing(found, found.oscillations()[0], 1e-3, "inertial")
        reach = np.abs(ahead.nodes - still.nodes).max()
        assert np.isclose(reach, 1e-3 * found.per_rod("length").sum(), rtol=1e-2)
        np.testing.assert_allclose(ahead.nodes + behind.nodes, 2 * still.nodes, atol=1e-2 * reach)
    with pytest.raises(DataError, match="no mode 99"):
        mode_shapes.plot(tmp_path / "case_modes.h5", tmp_path / "x.png", modes=[99])


def test_bubbles_of_modes_are_drawn(tmp_path):
    """One clamped rod: where its curve stands at a quarter and in the middle, by the three shapes."""
    chain = "&chain n_rods = 1, length = 2.0, mass_per_length = 1.5, bending_stiffness = 100.0, hinge_stiffness = 1e4 /\n"
    data = modes_of(tmp_path, "&case t_end = 1 /\n&spacecraft motion = 'fixed' /\n" + chain + "&model bending_shapes = 3, gauss_points = 5 /\n")
    second = int(np.flatnonzero(data.kind.values == "oscillation")[1])
    alpha, beta, bubble = (data[f"{name}_real"].values[second, 0] for name in ("alpha", "beta", "bubble"))
    middle = 2.0 * (alpha - beta) / 8 + bubble
    quarter = 2.0 * (9 * alpha - 3 * beta) / 64 + 9 / 16 * bubble
    with mode_shapes.open_modes(tmp_path / "case_modes.h5") as found:
        _, ahead, *_ = mode_shapes.swing(found, second, 1e-3, "moving")
    (start, end), curve = ahead.nodes, ahead.rods[0]
    across = np.array([start[1] - end[1], end[0] - start[0]]) / 2.0
    at_quarter, at_middle = ((curve[i] - start) @ across for i in (5, 10))
    assert abs(bubble) > 0.1 * abs(middle)
    assert np.isclose(at_quarter / at_middle, quarter / middle, rtol=1e-9)


SPINNING = (
    "&spacecraft mass = {mass}, inertia = {mass} /\n&chain n_rods = 8, length = 0.125, mass_per_length = 1, hinge_stiffness = 0 /\n"
    "&model bending = 'rigid' /\n&initial omega = 3 /\n"
)


@pytest.mark.parametrize(("mass", "options"), [(10, []), (1e6, []), (1e6, ["--equilibrium"])])
def test_a_spinning_chain_of_free_links_is_neutral(mass, options, tmp_path):
    """Its first two eigenvalues are a zero of one motion, which rounding makes +-3e-8; then sqrt(k (2 k - 1) - 1) times the spin."""
    data = modes_of(tmp_path, SPINNING.format(mass=mass), *options)
    assert data.attrs["stable"] == 1 and data.attrs["steady"] == 1
    kinds = list(data.kind.values)
    assert kinds == ["rigid body"] * 3 + ["mechanism"] + ["oscillation"] * 7
    if mass > 10:  # n links are off by some n^-2
        np.testing.assert_allclose(data.frequency[4:6], [3 * 5**0.5, 3 * 14**0.5], rtol=0.05)


def test_an_equilibrium_is_written_with_all_of_it(tmp_path):
    """Three rods, one hinge held, a force at the end: angles of all rods, moments by statics."""
    data = modes_of(
        tmp_path,
        "&spacecraft motion = 'fixed', hinge_x = 0.2 /\n&chain n_rods = 3, length = 1.2, 0.8, 0.7, mass_per_length = 2, "
        "bending_stiffness = 500, hinge_stiffness = 100, hinge_damping = 0.1 /\n&model formulation = 'consistent' /\n"
        "&initial phi = 0, 0.3, 0.3 /\n&hinge hinge = 1, held = .true. /\n"
        "&load target = 'node', node = 3, component = 'Y', value = 7 /\n"
        "&load target = 'node', node = 2, component = 'X', value = -4 /\n",
        "--equilibrium",
    )
    assert "phi_2" not in data.coordinate.values and list(data.hinge.values) == [0, 1, 2]
    phi, length = data.state_phi.values, np.array([1.2, 0.8, 0.7])
    node = np.cumsum(length * np.exp(1j * phi))
    force = np.array([0, -4, 7j])
    hinge = np.concatenate([[0], node[:-1]])
    moment = [sum((np.conj(node[j] - hinge[k]) * force[j]).imag for j in range(k, 3)) for k in range(3)]
    np.testing.assert_allclose(data.state_hinge_moment, moment, rtol=1e-9, atol=1e-9)
    angle = data.state_hinge_angle.values
    np.testing.assert_allclose(angle[[0, 2]] * 100, np.array(moment)[[0, 2]], rtol=1e-9)
    assert angle[1] == pytest.approx(0.3, abs=1e-12)
    opening = np.diff(phi, prepend=0) + data.state_alpha.values - np.concatenate([[0], data.state_beta.values[:-1]])
    np.testing.assert_allclose(angle, opening, atol=1e-12)


@pytest.mark.parametrize("seeds", [range(1001, 1041), pytest.param(range(1041, 1121), marks=pytest.mark.long)])
def test_equilibria_of_random_chains_with_freeplay_and_stops_are_found(tmp_path, seeds):
    """Against an independent potential energy."""
    faults = {seed: equilibria.fault_of(equilibria.Scene(np.random.default_rng(seed)), tmp_path) for seed in seeds}
    assert not any(faults.values()), {seed: fault for seed, fault in faults.items() if fault}


def test_freeplay_and_a_stop_in_one_hinge_do_not_lead_in_a_circle(tmp_path):
    text = (
        "&spacecraft motion = 'fixed' /\n&chain n_rods = 4, length = 1.25, mass_per_length = 1.52, node_mass = 0.581, "
        "hinge_stiffness = 774, 989, 658, 253, hinge_damping = 3.92, 0.128, 1.32, 0.106, kink = -0.00824, 0.177, 0, 0 /\n"
        "&model inertia = 'lumped', bending = 'rigid' /\n&initial phi = -0.277, 0.232, -0.0637, 0.241 /\n"
        "&load target = 'node', node = 4, component = 'X', value = -14.7 /\n"
        "&hinge hinge = 2, freeplay = 0.0957, upper_stop = 0.023, stop_stiffness = 4680 /\n"
    )
    data = modes_of(tmp_path, text, "--equilibrium")
    assert data.attrs["stable"] == 1
