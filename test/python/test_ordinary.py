"""Ordinary scenes with default settings against an independent formulation: free bodies, multipliers at the joints.

`ordinary_motions.json` is written by that formulation (bench/stability/multipliers), which shares nothing with the program:

    bench/stability/campaign.py --count 12 --store test/python/ordinary_motions.json

with a line for each scene that a longer campaign has found wrong since.
"""

import collections
import json
import os
import pathlib
import subprocess
import sys

import h5py
import numpy as np
import pytest
import result_files

sys.path.insert(0, str(result_files.ROOT / "bench" / "stability"))
from ordinary_scenes import FAMILIES, groups_of, text_of

STORED = json.loads((pathlib.Path(__file__).parent / "ordinary_motions.json").read_text())
RTOL, ATOL = 1e-8, 1e-10  # the defaults
NAMED = [("smooth", 42, "bdf", 1e-8), ("profiles", 7, "adams", 1e-8), ("profiles", 7, "dop853", 1e-8), ("quasistatic", 124, "erk", 1e-5)]


def run(scene, place, **keys):
    groups = [(name, given | {"n_outputs": 10} if name == "case" else given) for name, given in groups_of(scene["family"], scene["seed"])]
    (place / "case.nml").write_text(text_of(groups, **keys))
    return subprocess.run([result_files.RODYN, "run", "case.nml", "--output", "case.h5", "--force", "--quiet"], cwd=place,
                          capture_output=True, text=True, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})


def fault(scene, place, **keys):
    """What is wrong with a scene; empty if nothing."""
    done = run(scene, place, **keys)
    if done.returncode:
        return done.stderr.strip()
    with h5py.File(place / "case.h5") as file:
        phi = file["phi"][:]
        events = collections.defaultdict(list)
        if "events" in file:
            rows = zip(*(file["events"][name][:] for name in ("time", "kind", "hinge")), strict=True)
            for t, kind, hinge in sorted(rows):  # of events at one time, the order is no matter
                if t > 0.0:
                    events[str(hinge)].append(kind.decode().strip())
    bound = 100.0 * (keys.get("rtol", RTOL) * scene["scale"] + ATOL)
    error = max((np.max(np.abs(phi[row] - there)) for row, there in zip(scene["rows"], scene["phi"], strict=True)), default=0.0)
    if error > bound:
        return f"phi is off by {error:.1e} rad, {error / bound:.3g} of what it may be"
    for hinge, kinds in scene["events"].items():
        if events[hinge][:len(kinds)] != kinds or (scene["whole"] and len(events[hinge]) != len(kinds)):
            return f"hinge {hinge}: {len(events[hinge])} events, {len(kinds)} by the reference"
    return ""


@pytest.mark.parametrize("family", FAMILIES)
def test_ordinary_scenes_move_as_free_bodies_with_multipliers_do(family, tmp_path):
    scenes = [scene for scene in STORED if scene["family"] == family]
    assert len(scenes) >= 12
    faults = {scene["seed"]: fault(scene, tmp_path) for scene in scenes}
    assert not any(faults.values()), "\n".join(f"{family} {seed}: {text}" for seed, text in faults.items() if text)


@pytest.mark.parametrize(("family", "seed", "method", "rtol"), NAMED)
def test_named_methods_stay_within_a_hundred_tolerances(family, seed, method, rtol, tmp_path):
    """With larger tolerances for each step they were off by 120 to 320 in these scenes: errors add up from period to period."""
    (scene,) = [scene for scene in STORED if (scene["family"], scene["seed"]) == (family, seed)]
    assert fault(scene, tmp_path, rtol=rtol, method=method) == ""


def test_bdf_that_is_hardly_ahead_is_not_taken_where_each_event_restarts_it(tmp_path):
    assert run({"family": "sequences", "seed": 31}, tmp_path).returncode == 0
    with h5py.File(tmp_path / "case.h5") as file:
        assert file["solver"].attrs["method"].decode() == "dop853"
