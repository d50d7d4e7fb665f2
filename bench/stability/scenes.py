"""One short scene of every kind: every method, every model, both kernels, every law of loads."""

SPACECRAFT = "&spacecraft mass = 122.5, inertia = 10, hinge_x = 0.35, hinge_y = 0.35 /\n"
FIXED = "&spacecraft motion = 'fixed', hinge_x = 0.35 /\n"
CHAIN = """&chain n_rods = 3, length = 1.5, 1.4, 1.3, mass_per_length = 1.7, bending_stiffness = 1.37e4,
   node_mass = 0.5, hinge_stiffness = 6000, 2*4000, hinge_damping = 0.02, kink = 0, 0.05, 0 /
"""
MOMENT = "&load component = 'M', value = 1500, t_end = 0.02 /\n"
LOADS = MOMENT + """&load target = 'node', node = 2, component = 'Y', law = 'sine_squared', value = 50, rate = 40 /
&load law = 'table', component = 'X', times = 0, 0.01, 0.03, values = 0, 400, 100, after = 'hold' /
&load law = 'smooth_step', component = 'Y', t_start = 0.01, rise_time = 0.02, value = 300 /
"""
MODELS = {
    "consistent": "&model /\n",
    "paper": "&model formulation = 'paper' /\n",
    "assembled": "&model kernel = 'assembled' /\n",
    "paper, assembled": "&model formulation = 'paper', kernel = 'assembled' /\n",
    "rigid": "&model bending = 'rigid' /\n",
    "lumped": "&model inertia = 'lumped', bending = 'rigid' /\n",
    "quasistatic": "&model inertia = 'lumped', bending = 'quasistatic' /\n",
    "exact dampers": "&model inertia = 'lumped', bending = 'quasistatic', dampers = 'exact' /\n",
}
METHODS = ["auto", "adams", "bdf", "erk", "dop853", "gauss"]
FIXED_STEPS = {"erk": 2e-4, "dop853": 5e-4, "gauss": 1e-3}


def scenes(t_end: float = 0.05, rtol: float = 1e-8, atol: float = 1e-10) -> dict[str, str]:
    """Name -> case. Each model with each method that takes it, and each method with fixed steps."""
    times = f"&case title = 'A scene', t_end = {t_end}, n_outputs = 10 /\n"
    found = {}
    for model, text in MODELS.items():
        for method in METHODS:
            if method == "gauss" and model == "exact dampers":
                continue
            solver = f"&solver method = '{method}', rtol = {rtol}, atol = {atol} /\n"
            found[f"{model}, {method}"] = times + SPACECRAFT + CHAIN + LOADS + text + solver
    for method, step in FIXED_STEPS.items():
        solver = f"&solver method = '{method}', fixed_step = {step} /\n"
        found[f"fixed steps, {method}"] = times + FIXED + CHAIN + LOADS + solver
    found["no ledger"] = times + SPACECRAFT + CHAIN + LOADS + "&output ledger = .false., compression = 0 /\n"
    return found
