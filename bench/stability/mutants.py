"""Damaged namelists, the same for the same seed: bytes, tokens, numbers, groups and sizes of files that were valid.

    base, text, kind = mutant(20170707, 12)   # mutant 12; `base` is None, or the case of a sweep
"""

from __future__ import annotations

import random
import re

SPACECRAFT = "&spacecraft mass = 122.5, inertia = 10, hinge_x = 0.35, hinge_y = 0.35 /\n"
CHAIN = """&chain n_rods = 3, length = 1.5, 1.4, 1.3, mass_per_length = 1.7, bending_stiffness = 1.37e4,
   node_mass = 0.5, hinge_stiffness = 6000, 2*4000, hinge_damping = 0.02 /
"""
TIMES = "&case title = 'A mutant', t_end = 0.05, n_outputs = 5 /\n"
MOMENT = "&load component = 'M', value = 1500, t_end = 0.02 /\n"

#: Cases that take a few milliseconds, one of every kind.
CASES = [
    TIMES + SPACECRAFT + CHAIN + MOMENT,
    TIMES + SPACECRAFT + CHAIN + "&load target = 'node', node = 2, component = 'Y', law = 'sine_squared', value = 50, rate = 40 /\n"
    + "&model formulation = 'paper', kernel = 'assembled' /\n&solver method = 'bdf', rtol = 1e-6, atol = 1e-8, order = 4 /\n",
    TIMES + SPACECRAFT + CHAIN + MOMENT + "&model inertia = 'lumped', bending = 'quasistatic', dampers = 'exact' /\n"
    + "&solver method = 'adams', order = 8, max_step = 1e-3 /\n",
    TIMES + "&spacecraft motion = 'fixed', hinge_x = 0.35 /\n" + CHAIN.replace(" /\n", ", kink = 0, 0.05, 0 /\n")
    + "&model bending = 'rigid', gauss_points = 3 /\n&initial phi = 0.1, -0.2, 3*0.1 /\n".replace("3*", "")
    + "&solver method = 'erk', order = 6, fixed_step = 2e-4 /\n",
    TIMES + SPACECRAFT + CHAIN + "&load law = 'table', component = 'X', times = 0, 0.01, 0.03, values = 0, 400, 100, after = 'hold' /\n"
    + "&load law = 'smooth_step', component = 'Y', t_start = 0.01, rise_time = 0.02, value = 300 /\n"
    + "&solver method = 'dop853', rtol = 1e-9, max_steps = 5000 /\n&output ledger = .false., compression = 0 /\n",
    TIMES + SPACECRAFT + CHAIN + "&model inertia = 'lumped', bending = 'rigid' /\n&initial phi_rate = 1, velocity_x = 2, omega = -3,"
    + " rotation = 0.5 /\n&solver method = 'gauss', fixed_step = 1e-3 /\n",
]

#: Sweeps; their base is one of the cases.
SWEEPS = [
    "&sweep base = 'base.nml', combine = 'grid', probe_times = 0.01, 0.05 /\n&axis key = 'mass_ratio', values = 2, 4, 8 /\n"
    "&axis key = 'solver.rtol', values = 1e-6, 1e-8 /\n",
    "&sweep base = 'base.nml', combine = 'zip', keep_series = .true., lanes = .false. /\n"
    "&axis key = 'chain.hinge_stiffness(0)', start = 1e3, stop = 1e4, count = 4, spacing = 'log' /\n"
    "&axis key = 'case.n_outputs', values = 3, 4, 5, 6 /\n",
    "&sweep base = 'base.nml', case_seconds = 0.5 /\n&axis key = 'chain.n_rods', values = 1, 2, 3 /\n"
    "&axis key = 'case.t_end', values = 0.02, 0.04, 0.06, along = 'chain.n_rods' /\n",
    "&sweep base = 'base.nml' /\n&axis key = 'solver.method', text_values = 'bdf', 'dop853', 'gauss' /\n"
    "&axis key = 'chain.bending_stiffness', values = 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10 /\n",
]
#: Without arrays that must match n_rods, and without masses that a ratio would meet.
BASE = TIMES + SPACECRAFT + ("&chain n_rods = 2, length = 1.5, mass_per_length = 1.7, bending_stiffness = 1.37e4, "
                             "hinge_stiffness = 6000 /\n") + MOMENT

NUMBERS = ["0", "-0.0", "1", "-1", "0.1", "3", "1e-300", "4.9e-324", "1e-310", "1e300", "1.7976931348623157e308", "1.8e308", "1d400",
           "-1e300", "1e154", "1e-160", "1e16", "1e-16", "nan", "NaN(1)", "inf", "-infinity", "+Inf", "2147483647", "2147483648",
           "-2147483648", "9223372036854775808", "1e", "1e+", ".", "1.5.2", "0x10", "1_000", "1d3", "1q3", "1.e3", "100.0", "1e6",
           "12345678901234567890123456789", "0." + "3" * 400, "1" + "0" * 400, "1e99999999999", "(1,2)", "1+5", "1-300", "2*1e3"]
SIZES = ["0", "1", "2", "4", "7", "64", "67", "1000", "30000", "1000000", "1000001", "100000000", "2147483647", "-5"]
TOKENS = ["=", ",", ";", "/", "&", "&end", "$", "!", "'", '"', "''", "(", ")", "(1)", "(0)", "(-1)", "(1:2)", "(:)", "(99999999999)",
          "(2:1)", "(1:2:1)", "*", "2*", "0*1", "-1*2", "999999999*1", "1000000*1", "3*'x'", ".true.", ".t.", "t", "F", "true", "'free'",
          "'fixed'", "'lumped'", "'rigid'", "'quasistatic'", "'paper'", "'assembled'", "'exact'", "'node'", "'table'", "'smooth_step'",
          "'adams'", "'bdf'", "'gauss'", "'auto'", "n_rods", "length", "phi", "t_end", "%", "\\", "\t", "\r\n", "\n", "\n\n", "\0",
          "\x7f", "\ufeff", "\u00e9", "\u2028", "\U0001f680", "a" * 300, " " * 5000, "&load", "&axis", "&case t_end = 1 /", "/ /"]


LONG = 20_000  # bytes; what is longer is not damaged any further


def mutant(seed: int, number: int) -> tuple[bytes | None, bytes, str]:
    """Base of a sweep or None, the damaged text, and what was done to it."""
    rng = random.Random(f"{seed}-{number}")
    base = None
    text = rng.choice(CASES)
    if rng.random() < 0.35:
        base, text = BASE, rng.choice(SWEEPS)
    kind = rng.choice(list(MUTATIONS))
    in_base = base is not None and rng.random() < 0.25
    damaged = (base if in_base else text).encode()
    for _ in range(rng.choice([1, 1, 1, 1, 1, 2, 3, 8])):
        if len(damaged) > LONG:
            break
        damaged = MUTATIONS[kind](rng, damaged)
        if rng.random() < 0.2:
            kind = rng.choice(list(MUTATIONS))
    if in_base:
        return damaged, text.encode(), kind
    return base.encode() if base else None, damaged, kind


def pieces(text: bytes) -> list[bytes]:
    """Words, numbers, quoted texts, single characters and blanks; together they are the text."""
    return re.findall(rb"'[^'\n]*'|[A-Za-z_]\w*|[-+]?\.?\d[\w.+-]*|\s+|.", text, re.DOTALL)


def change_bytes(rng: random.Random, text: bytes) -> bytes:
    at = rng.randrange(len(text) + 1)
    length = rng.choice([1, 1, 1, 2, 5, 40])
    match rng.randrange(5):
        case 0:
            new = bytes(rng.randrange(256) for _ in range(length))
        case 1:
            new = b""
        case 2:
            return text[:at] + bytes([rng.randrange(256)]) + text[at:]
        case 3:
            return text[:at]
        case _:
            new = bytes(c ^ (1 << rng.randrange(8)) for c in text[at:at + length])
    return text[:at] + new + text[at + length:]


def change_tokens(rng: random.Random, text: bytes) -> bytes:
    parts = pieces(text) or [b""]
    i, k = rng.randrange(len(parts)), rng.randrange(len(parts))
    match rng.randrange(5):
        case 0:
            parts[i] = rng.choice(TOKENS).encode()
        case 1:
            parts.insert(i, rng.choice(TOKENS).encode())
        case 2:
            del parts[i]
        case 3:
            parts[i], parts[k] = parts[k], parts[i]
        case _:
            parts.insert(i, parts[k])
    return b"".join(parts)


def change_number(rng: random.Random, text: bytes, values: list[str] = NUMBERS, of: bytes = b"") -> bytes:
    """Another number in the place of one; `of`: only behind one of these keys."""
    places = [m for m in re.finditer(rb"(\b\w*)(?:\(\d\))?\s*=?\s*(?<![\w.])([-+]?\.?\d[\w.+-]*)", text) if not of or re.fullmatch(of, m[1])]
    if not places:
        return change_tokens(rng, text)
    place = rng.choice(places)
    new = rng.choice(values)
    if rng.random() < 0.3 and not of:
        new = f"{10.0 ** rng.uniform(-320, 308) * rng.choice([1, 1, 1, -1]):.17g}"
    elif rng.random() < 0.2 and not of:
        new = f"{10.0 ** rng.uniform(-8, 8) * rng.choice([1, 1, 1, -1]):.17g}"
    return text[:place.start(2)] + new.encode() + text[place.end(2):]


def change_groups(rng: random.Random, text: bytes) -> bytes:
    groups = re.findall(rb"[^&]*&[^&]*", text) or [text]
    i, k = rng.randrange(len(groups)), rng.randrange(len(groups))
    match rng.randrange(6):
        case 0:
            del groups[i]
        case 1:
            groups.insert(k, groups[i])
        case 2:
            groups[i], groups[k] = groups[k], groups[i]
        case 3:
            groups[i] = groups[i].replace(b"/", b"", 1)
        case 4:
            groups[i] = re.sub(rb"&\w+", b"&" + rng.choice([b"load", b"case", b"chain", b"axis", b"sweep", b"zzz", b""]), groups[i])
        case _:
            groups[i] = groups[i] * rng.choice([2, 10, 500])
    return b"".join(groups)


def change_sizes(rng: random.Random, text: bytes) -> bytes:
    match rng.randrange(7):
        case 0 | 1 | 2:
            return change_number(rng, text, SIZES, rb"n_rods|n_outputs|gauss_points|order|node|max_steps|count|n|compression")
        case 3:  # long lists
            length = rng.choice([3, 10, 1000, 100_000])
            return change_number(rng, text, [", ".join(["1.5"] * length), f"{length}*1.5", " ".join(map(str, range(length)))])
        case 4:
            return text.replace(b"\n", b"\n" * rng.choice([2, 1000]) + b"! " + b"x" * rng.choice([1, 200, 100_000]) + b"\n", 1)
        case 5:
            key = rng.choice([b"title", b"base", b"law", b"key", b"method"])
            return re.sub(key + rb"\s*=\s*'[^']*'", key + b" = '" + b"x" * rng.choice([1, 80, 81, 1000, 1001, 4097, 100_000]) + b"'", text)
        case _:
            group = rng.choice([MOMENT, SWEEPS[0], "&axis key = 'case.t_end', values = 0.01, 0.02 /\n"])
            return text + group.encode() * rng.choice([1, 9, 300])


MUTATIONS = {"bytes": change_bytes, "tokens": change_tokens, "numbers": change_number, "groups": change_groups, "sizes": change_sizes}
