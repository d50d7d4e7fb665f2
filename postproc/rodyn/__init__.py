"""Rodyn from Python: cases, runs, modes and sweeps in memory, without files and processes.

    import rodyn

    case = rodyn.Case("cases/table1.nml")
    case["chain.hinge_stiffness"] = [6e3] + 3 * [4e3]
    run = case.run()                 # xarray.Dataset, as that of the file of `rodyn run`
    modes = rodyn.modes(case)
    table = rodyn.sweep(case, {"chain.hinge_damping": [0.01, 0.02]}, {"phi_4": lambda run: run.phi[-1, 3]})

What is wrong with a case is a CaseError with all faults; a run that fails a RunError with the rows until then.
"""

from ._case import Case, CaseError, RodynError, RunError, modes
from ._library import version
from ._sweep import sweep

__all__ = ["Case", "CaseError", "RodynError", "RunError", "modes", "sweep", "version"]
