"""A solver that shares nothing with freqrail: its own reader of a case, its own equations, its own integral.

    python tests/reference/plain_solver.py

writes frozen.json, a hundred numbers of the shipped case and of others like it; `test_frozen.py` holds freqrail's to
them. It imports numpy and the standard library. The equations are eqs. (3) to (7) of the paper with the damper's
ends eliminated, one row a body, both misprints of eq. (4) corrected; the integral is a composite Gauss-Legendre rule
whose panels are halved until nothing changes.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
CASE = HERE.parents[1] / "cases" / "yu-damper-joint.toml"

# --- the reader: forty lines, no pint --------------------------------------------------------------

SCALES = {
    "kg": 1.0,
    "kg*m^2": 1.0,
    "m": 1.0,
    "N/m": 1.0,
    "kN/m": 1e3,
    "MN/m": 1e6,
    "GN/m": 1e9,
    "N*s/m": 1.0,
    "kN*s/m": 1e3,
    "m/N^(2/3)": 1.0,
    "km/h": 1000 / 3600,
    "Hz": 1.0,
}
TRACKS = {"german-low": (4.032e-7, 0.0206, 0.8246), "german-high": (1.080e-6, 0.0206, 0.8246)}


def quantity(text: str) -> float:
    """A number with a unit, in SI."""
    number, unit = text.split()
    return float(number) * SCALES[unit]


def read_case(path: Path) -> dict:
    """Vehicle, speed, track and band of a case file, in SI units."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    vehicle = {name: quantity(text) for name, text in tables["vehicle"].items() if name != "masses"}
    low, high = (float(part) for part in [text.split()[0] for text in tables["band"]["frequency"]])
    return {
        "vehicle": vehicle,
        "speed": quantity(tables["operation"]["speed"]),
        "track": TRACKS[tables["track"]["spectrum"]],
        "band": (low, high),
    }


def wheel_load(v: dict) -> float:
    """P0 below eq. (1), N, with the paper's g."""
    return 9.8 * (v["car_body_mass"] / 4 + v["bogie_mass"] / 2 + v["wheelset_mass"])


def contact_stiffness(v: dict) -> float:
    """K_H of eq. (1), N/m."""
    return 1.5 * wheel_load(v) ** (1 / 3) / v["contact_constant"]


# --- the model -------------------------------------------------------------------------------------


def responses(v: dict, speed: float, omega: np.ndarray) -> tuple[list[str], np.ndarray]:
    """Labels and transfer functions [series, n] per metre of track under the first wheel, at omega [n], rad/s."""
    a, b, contact = v["half_bogie_spacing"], v["half_wheelbase"], contact_stiffness(v)
    order = ["zc", "bc", "zt1", "bt1", "zt2", "bt2", "zw1", "zw2", "zw3", "zw4"]
    at = {name: k for k, name in enumerate(order)}
    masses = {"zc": "car_body_mass", "bc": "car_body_pitch_inertia"}
    masses |= {"zt1": "bogie_mass", "zt2": "bogie_mass", "bt1": "bogie_pitch_inertia", "bt2": "bogie_pitch_inertia"}
    masses |= dict.fromkeys(("zw1", "zw2", "zw3", "zw4"), "wheelset_mass")
    # elongation of each leg: upper end less lower end
    legs = [
        ("secondary", {"zc": 1, "bc": -a, "zt1": -1}),
        ("secondary", {"zc": 1, "bc": a, "zt2": -1}),
        ("primary", {"zt1": 1, "bt1": -b, "zw1": -1}),
        ("primary", {"zt1": 1, "bt1": b, "zw2": -1}),
        ("primary", {"zt2": 1, "bt2": -b, "zw3": -1}),
        ("primary", {"zt2": 1, "bt2": b, "zw4": -1}),
    ]
    s = 1j * omega
    z = np.zeros((omega.size, 10, 10), dtype=complex)
    for name, mass in masses.items():
        z[:, at[name], at[name]] += v[mass] * s**2
    rows = np.zeros((6, 10))
    for k, (stage, ends) in enumerate(legs):
        for name, arm in ends.items():
            rows[k, at[name]] = arm
        damper = v[f"{stage}_damping"] * s
        joint = v[f"{stage}_joint_stiffness"]
        damper = damper if np.isinf(joint) else 1 / (1 / damper + 2 / joint)
        z += (v[f"{stage}_stiffness"] + damper)[:, None, None] * np.outer(rows[k], rows[k])
    places = {"zw1": 0.0, "zw2": 2 * b, "zw3": 2 * a, "zw4": 2 * (a + b)}
    force = np.zeros((omega.size, 10), dtype=complex)
    for name, place in places.items():
        z[:, at[name], at[name]] += contact
        force[:, at[name]] = contact * np.exp(-s * place / speed)
    q = np.linalg.solve(z, force[..., None])[..., 0].T
    labels, found = [], []
    for place, arm in (("front", -a), ("centre", 0.0), ("rear", a)):
        labels.append(f"car_body_acceleration {place}")
        found.append(s**2 * (q[at["zc"]] + arm * q[at["bc"]]))
    for place, name in (("front", "zt1"), ("rear", "zt2")):
        labels.append(f"bogie_acceleration {place}")
        found.append(s**2 * q[at[name]])
    elongation = rows @ q
    labels += ["secondary_stroke front", "secondary_stroke rear", *(f"primary_stroke {n}" for n in (1, 2, 3, 4))]
    found += list(elongation)
    for n in (1, 2, 3, 4):
        labels.append(f"wheelset_acceleration {n}")
        found.append(s**2 * q[at[f"zw{n}"]])
    return labels, np.array(found)


def rms(v: dict, speed: float, track: tuple[float, float, float], band: tuple[float, float]) -> dict[str, float]:
    """RMS over a band in Hz by series: halve the panels until the mean squares no longer change."""
    roughness, low_cut, high_cut = track
    x, w = np.polynomial.legendre.leggauss(16)
    last, panels = None, 200
    while True:
        edges = np.geomspace(2 * np.pi * band[0], 2 * np.pi * band[1], panels + 1)
        middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        total: np.ndarray | float = 0.0
        for part in range(0, panels, 200):
            omega = (middle[part : part + 200, None] + half[part : part + 200, None] * x).ravel()
            weight = (half[part : part + 200, None] * w).ravel()
            wavenumber = omega / speed
            density = roughness * high_cut**2 / ((wavenumber**2 + low_cut**2) * (wavenumber**2 + high_cut**2)) / speed
            labels, transfer = responses(v, speed, omega)
            total = total + np.abs(transfer) ** 2 @ (density * weight)
        if last is not None and np.max(np.abs(total / last - 1)) < 1e-11:
            return dict(zip(labels, np.sqrt(total).tolist(), strict=True))
        last, panels = total, 2 * panels


def main() -> None:
    case = read_case(CASE)
    plain = case["vehicle"]
    low, high = "german-low", "german-high"
    soft = {"primary_joint_stiffness": 0.5e6, "secondary_joint_stiffness": 100e6}
    heavy = {
        "bogie_mass": 1300.0,
        "car_body_mass": 20000.0,
        "half_bogie_spacing": 8.75,
        "half_wheelbase": 1.25,
        "primary_joint_stiffness": np.inf,
    }
    rigid = {"primary_joint_stiffness": np.inf, "secondary_joint_stiffness": np.inf}
    chosen = [({}, low, 100.0), ({}, low, 250.0), ({}, high, 300.0), (rigid, low, 250.0)]
    chosen += [(soft, low, 250.0), (heavy, low, 160.0), (heavy, high, 250.0)]
    points = []
    for changes, track, kmh in chosen:
        vehicle = plain | changes
        found = {"static_wheel_load": wheel_load(vehicle), "contact_stiffness": contact_stiffness(vehicle)}
        found["rms"] = rms(vehicle, kmh / 3.6, TRACKS[track], case["band"])
        points.append({"changes": changes, "spectrum": track, "speed_kmh": kmh} | found)
    table = {"made_by": "python tests/reference/plain_solver.py", "points": points}
    text = json.dumps(table, indent=1).replace("Infinity", '"inf"')
    (HERE / "frozen.json").write_text(text + "\n", encoding="utf-8")
    print(sum(len(point["rms"]) + 2 for point in points), "numbers written")


if __name__ == "__main__":
    main()
