"""Mean squares over the whole axis in 50-digit arithmetic: the reference of tests/solver/test_residues.py.

    python tests/reference/make_whole_axis.py > tests/reference/whole_axis.json      (a few minutes; needs mpmath)

It shares no code with freqrail: the 26-state matrix is typed here from eqs. (3) to (8), its eigenvalues and
vectors come from mpmath, the four wheels' lags are summed pair by pair,

    sigma^2 = 1/2 sum over i, j of the integral over all omega of H_i(i w) H_j(-i w) G(w) e^{i w (tau_j - tau_i)},

each closed in the left half plane. With 50 digits the cancellation at merging poles costs nothing that matters.
"""

from __future__ import annotations

import json
import sys

from mpmath import cbrt, eig, exp, mp, mpf, pi, re, zeros

mp.dps = 50

PAPER = {
    "car_body_mass": "15200",
    "car_body_pitch_inertia": "1019000",
    "bogie_mass": "600",
    "bogie_pitch_inertia": "700",
    "wheelset_mass": "700",
    "primary_stiffness": "875e3",
    "primary_damping": "17e3",
    "secondary_stiffness": "412e3",
    "secondary_damping": "54e3",
    "half_bogie_spacing": "3.289",
    "half_wheelbase": "0.797",
}
HEAVY = PAPER | {  # a loaded freight wagon's proportions
    "car_body_mass": "41000",
    "car_body_pitch_inertia": "900000",
    "bogie_mass": "1300",
    "bogie_pitch_inertia": "950",
    "wheelset_mass": "620",
    "primary_stiffness": "3.1e6",
    "primary_damping": "9e3",
    "secondary_stiffness": "2.4e6",
    "secondary_damping": "31e3",
    "half_bogie_spacing": "5.1",
    "half_wheelbase": "0.9",
}
CONTACT = "5.1824e-8"
SPECTRUM = ("4.032e-7", "0.0206", "0.8246")

# vehicle, K_pd and K_sd in N/m, km/h
CASES = [
    (PAPER, "5e6", "5e6", "250"),
    (PAPER, "5e5", "5e5", "100"),
    (PAPER, "5e5", "5e5", "20"),
    (PAPER, "5e5", "5e5", "600"),
    (PAPER, "5e5", "1e8", "300"),
    (PAPER, "9e5", "5e6", "180"),
    (PAPER, "1e5", "1e5", "250"),
    (PAPER, "1e4", "1e4", "200"),
    (PAPER, "5e6", "inf", "250"),
    (PAPER, "inf", "5e6", "250"),
    (PAPER, "inf", "inf", "250"),
    (PAPER, "1e9", "1e10", "250"),
    (PAPER, "1e12", "1e9", "250"),
    (PAPER, "1e14", "1e15", "250"),
    # critical damping: two poles of the bounce or of the pitch chain are one, to the last bit of the stiffness
    (PAPER, "17286888.622689452", "69.82e6", "250"),
    (PAPER, "16582275.959194549", "69.82e6", "100"),
    (PAPER, "17.28626e6", "69822922.432233326", "60"),
    (PAPER, "50e6", "52585849.430768125", "250"),
    (PAPER, "12404975.369430856", "inf", "250"),
    (PAPER, "12251401.116145771", "inf", "400"),
    (PAPER, "17.28626e6", "69.82e6", "250"),  # and beside it
    (PAPER, "5e6", "5e6", "77.84414"),
    (PAPER, "5e6", "5e6", "77.84415"),
    (HEAVY, "2e6", "8e6", "120"),
    (HEAVY, "inf", "inf", "45"),
]

FREEDOMS = ("zc", "bc", "zt1", "bt1", "zw1", "zw2", "zt2", "bt2", "zw3", "zw4")


def row(**entries):
    return [entries.get(name, mpf(0)) for name in FREEDOMS]


def whole_axis(vehicle, primary_joint, secondary_joint, speed):
    """Mean squares of the paper's eleven series and of the four wheelsets' accelerations."""
    v = {name: mpf(text) for name, text in vehicle.items()}
    speed = mpf(speed) / mpf("3.6")
    lc, lt = v["half_bogie_spacing"], v["half_wheelbase"]
    load = (v["car_body_mass"] / 4 + v["bogie_mass"] / 2 + v["wheelset_mass"]) * mpf("9.8")
    contact = mpf("1.5") * cbrt(load) / mpf(CONTACT)
    inertia = [v["car_body_mass"], v["car_body_pitch_inertia"]]
    inertia += 2 * [v["bogie_mass"], v["bogie_pitch_inertia"], v["wheelset_mass"], v["wheelset_mass"]]
    one = mpf(1)
    elongations = [
        ("s", row(zc=one, bc=-lc, zt1=-one)),
        ("s", row(zc=one, bc=lc, zt2=-one)),
        ("p", row(zt1=one, bt1=-lt, zw1=-one)),
        ("p", row(zt1=one, bt1=lt, zw2=-one)),
        ("p", row(zt2=one, bt2=-lt, zw3=-one)),
        ("p", row(zt2=one, bt2=lt, zw4=-one)),
    ]
    spring = {"p": v["primary_stiffness"], "s": v["secondary_stiffness"]}
    dashpot = {"p": v["primary_damping"], "s": v["secondary_damping"]}
    series = {"p": primary_joint, "s": secondary_joint}
    inner = sum(series[kind] != "inf" for kind, _ in elongations)
    n = 20 + inner
    a, b = zeros(n), zeros(n, 4)
    q, delta = 10 + inner, 10
    for i in range(10):
        a[q + i, i] = 1
    for kind, e in elongations:
        rigid = series[kind] == "inf"
        kappa = mpf(0) if rigid else mpf(series[kind]) / 2
        for i in range(10):
            for j in range(10):
                a[i, q + j] -= (spring[kind] + kappa) * e[i] * e[j] / inertia[i]
                if rigid:
                    a[i, j] -= dashpot[kind] * e[i] * e[j] / inertia[i]
            if not rigid:
                a[i, delta] += kappa * e[i] / inertia[i]
                a[delta, q + i] += kappa / dashpot[kind] * e[i]
        if not rigid:
            a[delta, delta] -= kappa / dashpot[kind]
            delta += 1
    for column, wheel in enumerate((4, 5, 8, 9)):
        a[wheel, q + wheel] -= contact / inertia[wheel]
        b[wheel, column] = contact / inertia[wheel]
    poles, right = eig(a)
    modal_input = right**-1 * b

    roughness, low, high = (mpf(text) for text in SPECTRUM)

    def density(s):
        return roughness * high**2 * speed**3 / (((low * speed) ** 2 - s * s) * ((high * speed) ** 2 - s * s))

    ends = [
        (-low * speed, roughness * high**2 / (2 * low * (high**2 - low**2))),
        (-high * speed, roughness * high**2 / (2 * high * (low**2 - high**2))),
    ]
    lags = [mpf(0), 2 * lt / speed, 2 * lc / speed, 2 * (lt + lc) / speed]
    rows = [row(zc=one, bc=-lc), row(zc=one), row(zc=one, bc=lc), row(zt1=one), row(zt2=one)]
    rows += [e for _, e in elongations] + [row(zw1=one), row(zw2=one), row(zw3=one), row(zw4=one)]
    orders = [2] * 5 + [0] * 6 + [2] * 4
    squares = []
    for output, order in zip(rows, orders, strict=True):
        shape = [sum(output[i] * right[q + i, k] for i in range(10)) for k in range(n)]
        residue = [[shape[k] * modal_input[k, w] for k in range(n)] for w in range(4)]

        def transfer(w, s, residue=residue, order=order):
            return s**order * sum(residue[w][k] / (s - poles[k]) for k in range(n))

        mirrored = [[transfer(w, -p) for p in poles] for w in range(4)]
        total = mpf(0)
        for i in range(4):
            for j in range(4):
                lag = lags[j] - lags[i]
                x, y = (i, j) if lag >= 0 else (j, i)
                for k, p in enumerate(poles):
                    total += residue[x][k] * p**order * mirrored[y][k] * density(p) * exp(p * abs(lag))
                for p, rest in ends:
                    total += transfer(x, p) * transfer(y, -p) * rest * exp(p * abs(lag))
        squares.append(pi * re(total))
    return squares


def main():
    found = []
    for vehicle, primary, secondary, speed in CASES:
        squares = whole_axis(vehicle, primary, secondary, speed)
        case = {"vehicle": vehicle, "primary_joint_stiffness": primary, "secondary_joint_stiffness": secondary}
        found.append(case | {"speed_km_h": speed, "mean_squares": [mp.nstr(s, 20) for s in squares]})
        print(f"{primary} {secondary} {speed}", file=sys.stderr)
    head = {"made_by": "tests/reference/make_whole_axis.py", "contact_constant": CONTACT, "spectrum": SPECTRUM}
    json.dump(head | {"cases": found}, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
