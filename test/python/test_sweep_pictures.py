"""Pictures of sweeps and benchmarks show the numbers of their files; failed cases stay visible."""

import subprocess

import convergence
import exact_lumped
import figures
import h5py
import heat_map
import numpy as np
import pytest
import report
import result_files
import style
import sweep_lines
import work_precision
from rodyn_data import DataError, open_sweep


def labelled(axes):
    return {line.get_label(): np.asarray(line.get_xydata()) for line in axes.lines}


def crosses(axes):
    """x of the marks of failed cases, and their label."""
    for line in axes.lines:
        if line.get_marker() == "x":
            return np.asarray(line.get_xdata()).tolist(), line.get_label()
    return [], ""


@pytest.mark.parametrize(("name", "expected"), [
    pytest.param("inertia", {"lines", "exact-lumped"}, marks=pytest.mark.long), ("inertia_failed", {"lines", "exact-lumped"}),
    ("grid", {"lines", "map"}), ("orders", {"lines", "map", "convergence"}),
])
def test_every_picture_of_every_sweep_is_drawn(sweeps, tmp_path, monkeypatch, name, expected):
    monkeypatch.setattr(style, "FORMATS", (".png",))
    paths = figures.plot(sweeps[name], tmp_path / name)
    assert {path.stem.removeprefix(f"{name}-") for path in paths} == expected


def test_lines_split_by_the_other_axis(sweeps, tmp_path):
    figure = sweep_lines.plot(sweeps["inertia"], tmp_path / "x.png", ["phi(2)"], "mass_ratio")
    axes = figure.axes[0]
    lines = labelled(axes)
    ratio = np.array(result_files.RATIOS)
    assert np.allclose(lines["distributed"], np.stack([ratio, -2 / ratio], axis=1))
    assert np.allclose(lines["lumped"], np.stack([ratio, -2.2 / ratio], axis=1))
    assert axes.get_xscale() == "log" and axes.get_xlabel() == "total node mass / total rod mass"
    assert "[rad]" in axes.get_ylabel()


@pytest.mark.parametrize("name", ["inertia", "inertia_failed"])
def test_exact_and_lumped_stand_over_their_difference(sweeps, tmp_path, name):
    figure = exact_lumped.plot(sweeps[name], tmp_path / "x.png", ["phi(4)", "rotation"])
    top, bottom = figure.axes[0], figure.axes[2]
    ratio = np.array(result_files.RATIOS)
    lumped = -4.4 / ratio
    if name == "inertia_failed":
        lumped[1] = np.nan
        assert crosses(top) == ([4.0], "failed: 1 of 10 cases")
    assert np.allclose(labelled(top)["exact"][:, 1], -4 / ratio)
    assert np.allclose(labelled(top)["lumped"][:, 1], lumped, equal_nan=True)
    assert np.allclose(bottom.lines[0].get_ydata(), np.abs(-4 / ratio - lumped), equal_nan=True)
    assert bottom.get_yscale() == "log"


def test_a_sweep_without_both_kinds_of_inertia_is_told(sweeps, tmp_path):
    with pytest.raises(DataError, match=r"no axis 'model\.inertia'; it has chain\.hinge_stiffness"):
        exact_lumped.plot(sweeps["grid"], tmp_path / "x.png", ["phi(1)"])


def test_a_map_has_its_cells_where_its_axes_say(sweeps, tmp_path):
    figure = heat_map.plot(sweeps["grid"], tmp_path / "x.png", "phi(1)", ["mass_ratio", "chain.hinge_stiffness(0)"])
    axes = figure.axes[0]
    cells = axes.collections[0].get_array()
    expected = np.log10(result_files.STIFFNESS)[:, None] * np.array(result_files.RATIOS)
    failed = np.zeros(30, dtype=bool)
    failed[[0, 7, 22]] = True
    failed = failed.reshape(5, 6).T
    assert np.array_equal(np.ma.getmaskarray(cells).reshape(6, 5), failed)
    assert np.allclose(cells.reshape(6, 5)[~failed], expected[~failed])
    assert crosses(axes) == ([0, 1, 3], "failed: 3 of 30 cases")
    assert axes.get_ylabel() == "hinge stiffness $C_{0}$ [N m/rad]"
    assert [t.get_text() for t in axes.get_xticklabels()] == ["2", "4", "8", "16", "32"]


def test_a_map_says_what_its_dashed_line_is(sweeps, tmp_path):
    path = tmp_path / "signed.h5"
    path.write_bytes(sweeps["grid"].read_bytes())
    with h5py.File(path, "a") as file:
        file["phi"][...] = file["phi"][()] - np.nanmean(file["phi"][()])
    labels = [heat_map.plot(p, tmp_path / "x.png", "phi(1)").axes[1].get_ylabel() for p in (sweeps["grid"], path)]
    assert ["dashed line: zero" in label for label in labels] == [False, True]


def test_what_refines_nothing_has_no_order(sweeps, tmp_path):
    figure = convergence.plot(sweeps["inertia"], tmp_path / "x.png", ["phi(1)"], "mass_ratio", reference=[0.0])
    assert set(figure.fits.values()) == {None}
    assert {label.rpartition(": ")[2] for label in labelled(figure.axes[0]) if not label.startswith("_")} == {"no order"}


def test_fitted_orders_are_those_of_the_data(sweeps, tmp_path):
    figure = convergence.plot(sweeps["orders"], tmp_path / "x.png", ["phi(1)"], reference=[0.25])
    assert abs(figure.fits["phi(1)", "erk"].order - 2) < 1e-6
    assert abs(figure.fits["phi(1)", "dop853"].order - 4) < 0.01
    lines = labelled(figure.axes[0])
    assert np.allclose(lines["dop853: order 4.00"][:, 1], 5 * np.sort(result_files.STEPS) ** 4, rtol=1e-3)
    assert crosses(figure.axes[0]) == ([0.01], "failed: 1 of 10 cases")


def test_the_finest_case_serves_as_reference(sweeps, tmp_path):
    figure = convergence.plot(sweeps["orders"], tmp_path / "x.png", ["phi(1)"], where={"solver.method": "erk"})
    (fit,) = figure.fits.values()
    assert 1.9 < fit.order < 2.3 and fit.used.sum() == 3


def test_points_at_the_floor_of_rounding_are_not_fitted():
    h = 0.1 * 0.5 ** np.arange(8)
    error = h**4 + np.where(h < 0.01, 2e-9, 0.0) * np.array([1, 1, 1, 1, 1, 1.3, 0.9, 1.2])
    fit = convergence.fit_order(h, error, floor=1e-15)
    assert abs(fit.order - 4) < 0.1 and fit.used.sum() == 4
    assert convergence.fit_order(h[:1], error[:1], 0.0) is None


def test_a_run_can_be_the_reference(runs, sweeps, tmp_path):
    with pytest.raises(DataError, match="no row at t = 1 s"):
        convergence.plot(sweeps["orders"], tmp_path / "x.png", ["phi(1)"], reference=runs["n4"])


def test_what_a_sweep_lacks_is_said(runs, sweeps, tmp_path):
    for arguments, words in [
        ((["phi(9)"],), "no rod 9: there are rods 1 to 4"),
        ((["phi"],), r"write phi\(1\) to phi\(4\)"),
        ((["energy"],), "no data set 'energy'"),
        ((["phi(1)"], "length"), "no axis 'length'; it has mass_ratio, model.inertia"),
        ((["phi(1)"], "mass_ratio", {"mass_ratio": 3}), "no case with mass_ratio = 3; it has 2.0, 4.0"),
        ((["phi(1)"], "mass_ratio", {}, 2.0), "no probe time 2 s; it has 1 s"),
    ]:
        with pytest.raises(DataError, match=words):
            sweep_lines.plot(sweeps["inertia"], tmp_path / "x.png", *arguments)
    with pytest.raises(DataError, match="is a run file; this script reads sweep files"):
        sweep_lines.plot(runs["n1"], tmp_path / "x.png")
    with pytest.raises(DataError, match="no case is done"):
        figures.plot(sweeps["all_failed"], tmp_path / "x")


def test_a_sweep_of_failures_only_still_shows_them(sweeps, tmp_path):
    figure = sweep_lines.plot(sweeps["all_failed"], tmp_path / "x.png", ["phi(1)"])
    assert crosses(figure.axes[0]) == ([1.0, 2.0, 3.0], "failed: 3 of 3 cases")


def test_texts_of_any_kind_are_read(tmp_path):
    for kind in ("S16", "S3", "vlen"):
        path = result_files.write_sweep(tmp_path / f"{kind}.h5", {"solver.method": ["erk", "bdf"]}, np.ones((2, 1, 1)), text_type=kind)
        with open_sweep(path) as sweep:
            assert sweep.axis("solver.method").tolist() == ["erk", "bdf"]
            assert sweep.status == ["done", "done"] and sweep.done.all()


def test_states_at_the_end_are_quantities_too(sweeps, tmp_path):
    figure = sweep_lines.plot(sweeps["inertia"], tmp_path / "x.png", ["final_phi(2)", "final_rotation"])
    assert figure.axes[0].get_title(loc="left") == "phi of a rod, at the end of the case (rod 2)"
    assert np.allclose(labelled(figure.axes[0])["distributed"][:, 1], 100 - 2 / np.array(result_files.RATIOS))
    assert np.allclose(labelled(figure.axes[1])["lumped"][:, 1], 100 - 1.1 / np.array(result_files.RATIOS))


def test_an_axis_that_goes_along_with_another_splits_nothing(tmp_path):
    axes = {"solver.rtol": [1e-3, 1e-4] * 2, "solver.atol": [1e-5, 1e-6] * 2, "solver.method": ["adams"] * 2 + ["bdf"] * 2}
    path = result_files.write_sweep(tmp_path / "s.h5", axes, np.arange(4.0)[:, None, None] * np.ones((1, 1, 1)))
    figure = sweep_lines.plot(path, tmp_path / "x.png", axis="solver.rtol")
    assert {k: v[:, 1].tolist() for k, v in labelled(figure.axes[0]).items()} == {"adams": [1.0, 0.0], "bdf": [3.0, 2.0]}


@pytest.fixture(scope="module")
def frequencies(tmp_path_factory):
    """A sweep of frequencies alone and one of states and frequencies, by the program."""
    place = tmp_path_factory.mktemp("frequencies")
    (place / "base.nml").write_text(result_files.case("Two rods", 2, n_outputs=20, t_end=0.1))
    axis = "&axis key = 'chain.hinge_stiffness(0)', values = 1000, 2000, 4000 /\n"
    mass = "&axis key = 'chain.node_mass', values = 1, 2 /\n"
    for name, text in (("alone", "integrate = .false., frequencies = 9 /\n" + axis + mass),
                       ("both", "probe_times = 0.02, 0.05, 0.1, frequencies = 3, keep_series = .true. /\n" + axis)):
        (place / f"{name}.nml").write_text("&sweep base = 'base.nml', " + text)
        done = subprocess.run([result_files.RODYN, "sweep", f"{name}.nml"], cwd=place, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    return place


def test_columns_are_those_that_the_file_says(frequencies, tmp_path):
    """A mode is no probe time, and no rod."""
    names = ["frequency(1)", "frequency(3)", "damping_ratio(2)", "phi(2)", "omega", "final_phi(1)"]
    figure = sweep_lines.plot(frequencies / "both", tmp_path / "x.png", names, time=0.05)
    drawn = [axes.lines[0].get_ydata() for axes in figure.axes]
    with h5py.File(frequencies / "both" / "sweep.h5") as file:
        wanted = [file["frequency"][:, 0], file["frequency"][:, 2], file["damping_ratio"][:, 1], file["phi"][:, 1, 1],
                  file["omega"][:, 1], file["final_phi"][:, 0]]
    for ours, right in zip(drawn, wanted, strict=True):
        assert np.array_equal(ours, right)
    assert figure.axes[1].get_title(loc="left") == "natural frequency at the initial state (mode 3)"
    assert figure.axes[1].get_ylabel().endswith("[rad/s]")
    assert "t = 0.05 s" in figure.get_suptitle()
    figure = convergence.plot(frequencies / "both", tmp_path / "x.png", ["frequency(2)"], "chain.hinge_stiffness(0)")
    assert "t = " not in figure.get_suptitle()  # frequencies have no probe time
    with pytest.raises(DataError, match=r"write frequency\(1\) to frequency\(3\)"):
        sweep_lines.plot(frequencies / "both", tmp_path / "x.png", ["frequency"])
    with pytest.raises(DataError, match="no mode 4: there are modes 1 to 3"):
        sweep_lines.plot(frequencies / "both", tmp_path / "x.png", ["frequency(4)"])
    with pytest.raises(DataError, match="'series_omega' is a series in time"):
        sweep_lines.plot(frequencies / "both", tmp_path / "x.png", ["series_omega"])


def test_a_sweep_of_frequencies_has_pictures_and_a_report(frequencies, tmp_path, monkeypatch):
    monkeypatch.setattr(style, "FORMATS", (".png",))
    paths = figures.plot(frequencies / "alone", tmp_path / "alone")
    assert {path.stem.removeprefix("alone-") for path in paths} == {"frequencies", "map"}
    paths = figures.plot(frequencies / "both", tmp_path / "both")
    assert {path.stem.removeprefix("both-") for path in paths} == {"lines", "frequencies"}
    figure = heat_map.plot(frequencies / "alone", tmp_path / "x.png")
    with h5py.File(frequencies / "alone" / "sweep.h5") as file:
        assert np.array_equal(np.sort(figure.axes[0].collections[0].get_array().ravel()), np.sort(file["frequency"][:, 0]))
    report.plot(frequencies / "alone", tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert page.count("<figure>") == 2 and "Not drawn" not in page


def test_equal_cases_are_said_to_be_equal(tmp_path):
    path = result_files.write_sweep(tmp_path / "s.h5", {"case.n_outputs": [10, 20, 40]}, np.ones((3, 1, 1)))
    figure = convergence.plot(path, tmp_path / "x.png", ["phi(1)"])
    assert figure.fits == {("phi(1)", ""): None}
    assert [t.get_text() for t in figure.axes[0].texts] == ["no case differs from the reference"]
    result_files.write_sweep(path, {"case.n_outputs": [10, 20, 40]}, np.ones((3, 1, 1)), failed=[0, 1, 2])
    figure = convergence.plot(path, tmp_path / "x.png", ["phi(1)"])
    assert [t.get_text() for t in figure.axes[0].texts] == ["every case failed"]


def test_titles_of_pictures_are_whole_and_fit(tmp_path):
    """The title of the sweep is not cut to make room for what the picture shows."""
    path = result_files.write_sweep(tmp_path / "s.h5", {"case.n_outputs": [10, 20, 40]}, np.array([1.1, 1.01, 1.0]).reshape(3, 1, 1))
    with h5py.File(path, "a") as file:
        file.attrs["title"] = np.bytes_("Table 1: four rods, one second of thrust, of which nothing")
    figure = convergence.plot(path, tmp_path / "x.png", ["phi(1)"])
    assert figure.get_suptitle().startswith("Table 1: four rods, one second of thrust, of which nothing")
    assert figure.get_suptitle().endswith("error against the finest case of each line")
    box = figure._suptitle.get_window_extent()
    assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1
    assert all(box.y0 >= axes.title.get_window_extent().y1 for axes in figure.axes)


def test_a_directory_stands_for_its_sweep(tmp_path):
    result_files.write_sweep(tmp_path / "sweep.h5", {"mass_ratio": [1.0, 2.0]}, np.ones((2, 1, 1)))
    figure = sweep_lines.plot(tmp_path, tmp_path / "x.png")
    assert figure.axes[0].lines[0].get_ydata().tolist() == [1.0, 1.0]


def test_work_precision_pairs_errors_with_seconds(tmp_path):
    path = result_files.write_benchmark(tmp_path / "bench.h5")
    figure = work_precision.plot(path, tmp_path / "x.png")
    visible = [axes for axes in figure.axes if axes.get_visible()]
    assert len(visible) == 3  # beam: one error; table1: two
    table1 = next(axes for axes in visible if axes.get_title(loc="left") == "Scene table1")
    assert labelled(table1)["dop853"].tolist() == [[1e-12, 1.1], [1e-9, 0.7], [1e-5, 0.5]]
    assert labelled(table1)["adams"].tolist() == [[1e-7, 2.0], [1e-3, 1.0]]
    assert "failed, or without error" in labelled(table1)
    with pytest.raises(DataError, match="no scene 'x'; it has beam, table1"):
        work_precision.plot(path, tmp_path / "x.png", ["x"])
    with pytest.raises(DataError, match="is no benchmark file"):
        work_precision.plot(result_files.write_sweep(tmp_path / "s.h5", {}, np.ones((1, 1, 1))), tmp_path / "x.png")
