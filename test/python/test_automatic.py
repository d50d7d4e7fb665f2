"""What `method = 'auto'` takes where hinges are held, released and latch; counted, not timed."""

import pathlib
import subprocess

import h5py
import pytest
import result_files

RELEASED = """&case t_end = 2, n_outputs = 20 /
&spacecraft mass = 150, inertia = 150, hinge_x = 0.5 /
&chain n_rods = 1, length = 1.0, mass_per_length = 2.0, bending_stiffness = 3e4, hinge_stiffness = 5 /
&initial phi = 0.8 /
&hinge hinge = 0, held = .true., release_time = 0.1, rest_angle = -0.2 /
"""


def run(folder: pathlib.Path, text: str, method: str = "auto") -> dict:
    """Attributes of the solver and last angles of a case by a method."""
    case, result = folder / f"{method}.nml", folder / f"{method}.h5"
    case.write_text(f"{text}&solver method = '{method}' /\n")
    done = subprocess.run([result_files.RODYN, "run", case, "--output", result, "--force"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    with h5py.File(result) as file:
        solver = dict(file["solver"].attrs)
        return {"method": solver["method"].decode(), "reason": solver["reason"].decode(), "n_rhs": int(solver["n_rhs"]),
                "phi": file["phi"][-1], "printed": done.stdout}


def boom(n_rods: int, t_end: float) -> str:
    """A cantilever of held hinges under a force at its tip."""
    return (f"&case t_end = {t_end}, n_outputs = 10 /\n&spacecraft motion = 'fixed' /\n"
            f"&chain n_rods = {n_rods}, length = {8 / n_rods}, mass_per_length = 0.5, bending_stiffness = 800, hinge_stiffness = 0 /\n"
            f"&load target = 'node', node = {n_rods}, component = 'Y', value = 0.5, t_end = {0.7 * t_end} /\n"
            + "".join(f"&hinge hinge = {k}, held = .true. /\n" for k in range(n_rods)))


def test_a_chain_that_is_released_later_is_judged_as_it_will_be(tmp_path: pathlib.Path) -> None:
    auto, gauss = run(tmp_path, RELEASED), run(tmp_path, RELEASED, "gauss")
    assert auto["method"] == "gauss"
    assert auto["n_rhs"] <= 1.1 * gauss["n_rhs"]


@pytest.mark.parametrize(("n_rods", "t_end"), [(4, 1.0), (16, 0.1), (64, 0.03)])
def test_held_hinges_are_no_events(tmp_path: pathlib.Path, n_rods: int, t_end: float) -> None:
    auto, explicit = run(tmp_path, boom(n_rods, t_end)), run(tmp_path, boom(n_rods, t_end), "dop853")
    assert auto["method"] == "gauss"
    assert auto["phi"] == pytest.approx(explicit["phi"], rel=1e-6)


def test_the_file_and_the_terminal_tell_of_every_method(tmp_path: pathlib.Path) -> None:
    latched = RELEASED.replace("rest_angle", "latch_angle = 0.78, rest_angle")
    auto, explicit = run(tmp_path, latched), run(tmp_path, latched, "dop853")
    assert auto["method"] == "gauss, dop853"
    assert "\nfrom t = " in auto["reason"]
    assert "\nmethod  from t = " in auto["printed"]
    assert auto["phi"] == pytest.approx(explicit["phi"], abs=1e-6)


# Chains at rest until a load sets them in motion, whose ledger `adams` and `bdf` worked on without end: the powers are rounding alone.
HUB = "&spacecraft mass = 300, inertia = 80, hinge_x = 0.7 /\n"
FROM_REST = {
    "strong dampers": "&case t_end = 0.5, n_outputs = 20 /\n" + HUB +
    "&chain n_rods = 2, length = 2, mass_per_length = 0.8, bending_stiffness = 2000, node_mass = 2, hinge_stiffness = 1500,"
    " hinge_damping = 5000 /\n&load component = 'M', t_start = 0.25, value = 20 /\n",
    "strong dampers and stops": "&case t_end = 20, n_outputs = 200 /\n" + HUB +
    "&chain n_rods = 12, length = 1, mass_per_length = 0.8, bending_stiffness = 1e6, node_mass = 0.2, hinge_stiffness = 100,"
    " hinge_damping = 500 /\n&load component = 'M', t_start = 1, t_end = 4, value = 20 /\n"
    "&hinge hinge = 0, lower_stop = -0.3, upper_stop = 0.3, stop_stiffness = 1000, stop_damping = 10 /\n",
    "bang-bang slew": "&case t_end = 4, n_outputs = 100 /\n" + HUB +
    "&chain n_rods = 3, length = 2, mass_per_length = 0.8, bending_stiffness = 2000, node_mass = 0, 0, 2, hinge_stiffness = 1500,"
    " hinge_damping = 3 /\n&load component = 'M', t_start = 1, t_end = 4, value = 20 /\n"
    "&load component = 'M', t_start = 4, t_end = 7, value = -20 /\n",
    "one rod": "&case t_end = 0.5, n_outputs = 20 /\n" + HUB +
    "&chain n_rods = 1, length = 2, mass_per_length = 0.8, bending_stiffness = 2000, node_mass = 2, hinge_stiffness = 1500,"
    " hinge_damping = 0 /\n&load component = 'M', t_start = 0.25, t_end = 4, value = 20 /\n",
    "friction": "&case t_end = 20, n_outputs = 100 /\n&spacecraft mass = 120, inertia = 300, hinge_x = 0.6 /\n"
    "&chain n_rods = 2, length = 1.2, 2, mass_per_length = 2*0.76, node_mass = 2*0.24, hinge_stiffness = 100, 12 /\n"
    "&model formulation = 'consistent', inertia = 'distributed', bending = 'rigid' /\n"
    "&hinge hinge = 0, friction_moment = 0.34, friction_velocity = 0.1 /\n"
    "&load component = 'M', t_start = 2.96, t_end = 8.97, value = 16 /\n",
}


@pytest.mark.parametrize("name", FROM_REST)
def test_a_ledger_of_a_chain_that_begins_to_move_ends(tmp_path: pathlib.Path, name: str) -> None:
    text = FROM_REST[name]
    methods = ["auto"]  # with strong dampers and stops the others take their time with and without a ledger
    if name != "strong dampers and stops":
        methods += ["adams", "bdf"]
    if "&hinge" not in text:
        methods += ["gauss"]
    ends = {method: run(tmp_path, text, method)["phi"] for method in methods}
    for method in methods:
        assert ends[method] == pytest.approx(ends["auto"], abs=1e-5), method
