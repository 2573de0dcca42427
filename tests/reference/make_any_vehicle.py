"""Mean squares of two vehicles that no chain describes, with 60 digits: for tests/solver/test_any_vehicle.py.

    python tests/reference/make_any_vehicle.py > tests/reference/any_vehicle.json      (some minutes; needs mpmath)

One vehicle has unlike legs and pivots in front and at the rear, the other a car body that bends. It shares no code with
freqrail: first-order equations are typed here from the bodies and legs below, eigenvalues and vectors come from mpmath.
Over the whole axis the lags are summed pair by pair and closed in the left half plane, as in make_whole_axis.py; over
bands |sum over the wheels of H_w e^{i w x_w/v}|^2 G is integrated by mpmath's Gauss-Legendre rule between break points
that close in on every pole, with 30 digits.
"""

from __future__ import annotations

import json
import sys

from mpmath import eig, exp, mp, mpf, pi, quad, re, workdps, zeros

mp.dps = 60

ROUGHNESS, LOW, HIGH = "4.032e-7", "0.0206", "0.8246"
BANDS_HZ = (("0.1", "100"), ("0.5", "400"))

# a leg: upper end, lower end (freedom -> arm), spring, dashpot, stiffness of each of its two joints, "inf" for none
ASYMMETRIC = {
    "freedoms": {"car": "15200", "pitch": "1019000", "z1": "600", "b1": "700", "z2": "730", "b2": "810",
                 "w1": "700", "w2": "700", "w3": "640", "w4": "640"},
    "legs": {
        "secondary_front": [{"car": "1", "pitch": "-3.1", "z1": "-1"}, "412e3", "54e3", "5e6"],
        "secondary_rear": [{"car": "1", "pitch": "3.6", "z2": "-1"}, "530e3", "31e3", "0.9e6"],
        "primary_1": [{"z1": "1", "b1": "-0.797", "w1": "-1"}, "875e3", "17e3", "5e6"],
        "primary_2": [{"z1": "1", "b1": "0.797", "w2": "-1"}, "875e3", "17e3", "5e6"],
        "primary_3": [{"z2": "1", "b2": "-0.9", "w3": "-1"}, "1.1e6", "9e3", "inf"],
        "primary_4": [{"z2": "1", "b2": "0.9", "w4": "-1"}, "1.1e6", "9e3", "inf"],
    },
    "wheels": {"w1": "3.897", "w2": "2.303", "w3": "-2.7", "w4": "-4.5"},
    "contact": "1.0448e9",
    "speed": "69",
    "outputs": ["acceleration car", "acceleration b2", "acceleration w3", "elongation secondary_rear",
                "elongation primary_3"],
}  # fmt: skip
BENDING = {
    "freedoms": {"car": "15200", "pitch": "500000", "bend": "3800", "z1": "600", "b1": "700", "z2": "600", "b2": "700",
                 "w1": "700", "w2": "700", "w3": "700", "w4": "700"},
    "legs": {
        "beam": [{"bend": "1"}, "12157000", "6450", "inf"],  # about 9 Hz, 1.5 %
        "secondary_front": [{"car": "1", "pitch": "-8", "bend": "-0.31", "z1": "-1"}, "412e3", "54e3", "5e6"],
        "secondary_rear": [{"car": "1", "pitch": "8", "bend": "-0.31", "z2": "-1"}, "412e3", "54e3", "5e6"],
        "primary_1": [{"z1": "1", "b1": "-1.2", "w1": "-1"}, "875e3", "17e3", "8e6"],
        "primary_2": [{"z1": "1", "b1": "1.2", "w2": "-1"}, "875e3", "17e3", "8e6"],
        "primary_3": [{"z2": "1", "b2": "-1.2", "w3": "-1"}, "875e3", "17e3", "8e6"],
        "primary_4": [{"z2": "1", "b2": "1.2", "w4": "-1"}, "875e3", "17e3", "8e6"],
    },
    "wheels": {"w1": "9.2", "w2": "6.8", "w3": "-6.8", "w4": "-9.2"},
    "contact": "1.0448e9",
    "speed": "80",
    "outputs": ["acceleration car", "acceleration bend", "acceleration z2", "elongation secondary_front",
                "elongation primary_4"],
}  # fmt: skip


def equations(vehicle):
    """(A [n, n], B [n, wheels], rows of the elongations) with the states dq/dt, inner elongations, q."""
    freedoms, masses = list(vehicle["freedoms"]), [mpf(m) for m in vehicle["freedoms"].values()]
    wheels = list(vehicle["wheels"])
    rows = {name: [mpf(leg[0].get(f, "0")) for f in freedoms] for name, leg in vehicle["legs"].items()}
    inner = [name for name, leg in vehicle["legs"].items() if leg[3] != "inf"]
    m, n = len(freedoms), 2 * len(freedoms) + len(inner)
    q = m + len(inner)
    a, b = zeros(n), zeros(n, len(wheels))
    for i in range(m):
        a[q + i, i] = 1
    for name, (_, spring, dashpot, joint) in vehicle["legs"].items():
        e, k, c = rows[name], mpf(spring), mpf(dashpot)
        for i in range(m):
            for j in range(m):
                a[i, q + j] -= k * e[i] * e[j] / masses[i]
                if joint == "inf":
                    a[i, j] -= c * e[i] * e[j] / masses[i]
                else:
                    a[i, q + j] -= mpf(joint) / 2 * e[i] * e[j] / masses[i]
            if joint != "inf":
                state = m + inner.index(name)
                a[i, state] += mpf(joint) / 2 * e[i] / masses[i]
                a[state, q + i] += mpf(joint) / 2 / c * e[i]
        if joint != "inf":
            state = m + inner.index(name)
            a[state, state] -= mpf(joint) / 2 / c
    for column, wheel in enumerate(wheels):
        i = freedoms.index(wheel)
        a[i, q + i] -= mpf(vehicle["contact"]) / masses[i]
        b[i, column] = mpf(vehicle["contact"]) / masses[i]
    outputs = [("acceleration " + f, [mpf(f == g) for g in freedoms], 2) for f in freedoms]
    outputs += [("elongation " + name, rows[name], 0) for name in rows]
    return a, b, q, [each for each in outputs if each[0] in vehicle["outputs"]]


def mean_squares(vehicle):
    """{output: [whole axis, *bands]}."""
    a, b, q, outputs = equations(vehicle)
    poles, right = eig(a)
    modal_input = right**-1 * b
    speed, places = mpf(vehicle["speed"]), [mpf(x) for x in vehicle["wheels"].values()]
    roughness, low, high = mpf(ROUGHNESS), mpf(LOW), mpf(HIGH)
    count, wheels, n = len(poles), len(places), len(vehicle["freedoms"])

    def density(s):
        return roughness * high**2 * speed**3 / (((low * speed) ** 2 - s * s) * ((high * speed) ** 2 - s * s))

    ends = [
        (-low * speed, roughness * high**2 / (2 * low * (high**2 - low**2))),
        (-high * speed, roughness * high**2 / (2 * high * (low**2 - high**2))),
    ]
    result = {}
    for name, row, order in outputs:
        shape = [sum(row[i] * right[q + i, k] for i in range(n)) for k in range(count)]
        residue = [[shape[k] * modal_input[k, w] for k in range(count)] for w in range(wheels)]

        def transfer(w, s, residue=residue, order=order):
            return s**order * sum(residue[w][k] / (s - poles[k]) for k in range(count))

        mirrored = [[transfer(w, -p) for p in poles] for w in range(wheels)]
        total = mpf(0)
        for i in range(wheels):
            for j in range(wheels):
                lag = (places[i] - places[j]) / speed
                x, y = (i, j) if lag >= 0 else (j, i)
                for k, p in enumerate(poles):
                    total += residue[x][k] * p**order * mirrored[y][k] * density(p) * exp(p * abs(lag))
                for p, rest in ends:
                    total += transfer(x, p) * transfer(y, -p) * rest * exp(p * abs(lag))
        found = [pi * re(total)]

        def power(omega, residue=residue, order=order):
            s = 1j * omega
            waves = [exp(1j * omega * x / speed) for x in places]
            response = mpf(0)
            for k in range(count):
                response += sum(residue[w][k] * waves[w] for w in range(wheels)) / (s - poles[k])
            return abs(s**order * response) ** 2 * re(density(s))

        with workdps(30):
            for band in BANDS_HZ:
                first, last = (2 * pi * mpf(f) for f in band)
                found.append(quad(power, breaks(poles, first, last), maxdegree=4, method="gauss-legendre"))
        result[name] = [mp.nstr(each, 20) for each in found]
        print(name, result[name], file=sys.stderr)
    return result


def breaks(poles, first, last):
    """Break points between two frequencies, rad/s, that close in on every pole and are near enough for the lags."""
    points = {first, last}
    for p in poles:
        for k in range(24):
            points |= {abs(p.imag) + abs(p.real) * 2**k / 2, abs(p.imag) - abs(p.real) * 2**k / 2, abs(p.imag)}
    step = (last - first) / 40
    points |= {first + step * k for k in range(40)}
    inside = sorted(x for x in points if first <= x <= last)
    kept = [inside[0]]
    for x in inside[1:]:
        if x - kept[-1] > min(abs(x - p) for w in poles for p in (abs(w.imag) + 1j * w.real,)) / 3:
            kept.append(x)
    kept[-1] = last
    return kept


def main():
    vehicles = {"asymmetric": ASYMMETRIC, "bending": BENDING}
    found = {name: vehicle | {"mean_squares": mean_squares(vehicle)} for name, vehicle in vehicles.items()}
    head = {"made_by": "tests/reference/make_any_vehicle.py", "spectrum": (ROUGHNESS, LOW, HIGH), "bands_hz": BANDS_HZ}
    json.dump(head | {"vehicles": found}, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
