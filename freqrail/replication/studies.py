"""The datasets of the paper's study: what its sections V and VI compute, and what explains it.

- "grid": RMS over Table I for both joints and 100 to 300 km/h (figs. 5 to 7);
- "map": RMS over both joints' stiffness, finely, at the paper's speed;
- "spectra": PSDs and cumulative RMS at the paper's speed, for a few joints;
- "track": heights under the wheels and the responses of both models in time at the paper's point (figs. 3 and 4);
- "dampers": dynamic stiffness of the dampers with their joints, for Table I.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.case import Case, load_case
from freqrail.case.parameters import JOINTS
from freqrail.confirm.track_record import fixed_amplitudes, spectral_lines, stream
from freqrail.model.band import band_limits
from freqrail.model.equations import leg_dynamic_stiffness
from freqrail.model.inputs import wheel_lags
from freqrail.model.responses import PAPER, RESPONSES
from freqrail.model.variants import PREFIXES
from freqrail.model.vehicle import Vehicle
from freqrail.replication.claims import PAPER_POINT, PAPER_SPEED
from freqrail.replication.judging import OTHER_JOINT
from freqrail.result.labels import attributes, position_coordinates
from freqrail.solver.transfer import half_vehicle_transfer
from freqrail.sweep.sweep import sweep
from freqrail.types import Progress

CASE = "yu-damper-joint"
TABLE_I = (0.5, 1.0, 5.0, 10.0, 50.0, 100.0)  # MN/m

_PAPER_SPEED = f"{PAPER_SPEED:g} km/h"
MAP_AXIS = "log:0.5:100:33 MN/m"
SPECTRUM_JOINTS = f"0.5, {OTHER_JOINT:g}, 100 MN/m"
SPECTRUM_AXIS = "log:0.1:100:400 Hz"

STAGES = ("secondary", "primary")
PERIOD = 20.0  # s, the paper's simulation time
RATE = 250.0  # samples a second of the histories: above twice the band's end
SEED, KEY = 0, "replicate"


def study_case() -> Case:
    """The shipped case of the paper."""
    return load_case(CASE)


def paper_grid(progress: Progress = lambda points: None) -> xr.Dataset:
    """RMS over Table I for both joints and all speeds of section VI."""
    return sweep(CASE, progress=progress)


def joint_map(progress: Progress = lambda points: None) -> xr.Dataset:
    """RMS over both joints' stiffness at the paper's speed."""
    return sweep(CASE, over={"speed": _PAPER_SPEED, **dict.fromkeys(JOINTS, MAP_AXIS)}, progress=progress)


def spectra(progress: Progress = lambda points: None) -> xr.Dataset:
    """PSDs at the paper's speed for soft, the paper's and stiff joints, and the RMS up to each frequency."""
    axes = {"speed": _PAPER_SPEED, **dict.fromkeys(JOINTS, SPECTRUM_JOINTS), "frequency": SPECTRUM_AXIS}
    result = sweep(CASE, over=axes, psd=True, progress=progress)
    for prefix in PREFIXES:
        for name, response in RESPONSES.items():
            key = f"{prefix}{name}"
            if f"{key}_psd" in result:
                up_to = result[f"{key}_psd"].cumulative_integrate("frequency") ** 0.5
                up_to.attrs = {
                    "units": response.unit,
                    "long_name": f"RMS up to a frequency of the {response.long_name}, {PREFIXES[prefix]}",
                }
                result[f"{key}_cumulative_rms"] = up_to
    corners = corner_frequencies(study_case().vehicle)
    return result.assign_attrs(corner_frequency=min(corners.values()))


# --- time histories --------------------------------------------------------------------------------


def histories() -> xr.Dataset:
    """One record of the track under the four wheels and both models' steady responses to it, at the paper's point.

    Sums of the band's harmonics on 20 s, the responses' amplitudes from the frequency responses: no integration in
    time, no start. Dimensions sample (at `time`) and axle, and each response's own.
    """
    case = study_case()
    vehicle, speed = case.vehicle, PAPER_SPEED / 3.6
    low, high = band_limits(case.band, speed) / (2 * np.pi) if case.band else (1 / PERIOD, RATE / 2)
    lines = spectral_lines(case.spectrum, speed, (float(low), float(high)), PERIOD)
    amplitudes = fixed_amplitudes(lines, stream(SEED, KEY, "fixed amplitudes", 0))
    omega, lags = 2 * np.pi * lines.frequency, wheel_lags(vehicle, speed)
    samples = round(PERIOD * RATE)

    def in_time(transfer: NDArray[np.complex128]) -> NDArray[np.float32]:
        """Sums of harmonics [..., samples] from amplitudes per metre [..., K]."""
        spectrum = np.zeros((*transfer.shape[:-1], samples // 2 + 1), dtype=complex)
        spectrum[..., lines.order] = transfer * amplitudes * (samples / 2)
        return np.fft.irfft(spectrum, samples).astype("float32")  # to be drawn

    metre = {"units": "m"}
    variables: dict[str, Any] = {
        "track_height": (
            ("axle", "sample"),
            in_time(np.exp(-1j * np.multiply.outer(lags, omega))),
            metre | {"long_name": "track height under a wheel"},
        ),
        "lag": (("axle",), lags, {"units": "s", "long_name": "lag of a wheel behind the first (eq. 2)"}),
    }
    # transfer functions are per metre under the vehicle's centre, the record is the first wheel's
    centre = np.exp(-1j * omega * lags[-1] / 2)
    for prefix, model in (("", vehicle), ("traditional_", vehicle.traditional())):
        for name, transfer in half_vehicle_transfer(model, PAPER, omega, speed).items():
            response = RESPONSES[name]
            variables[f"{prefix}{name}_history"] = (
                (response.dimension, "sample"),
                in_time(transfer * centre),
                {"units": response.unit, "long_name": f"{response.long_name} in time, {PREFIXES[prefix]}"},
            )
    coordinates: dict[str, Any] = {
        "time": ("sample", np.arange(samples) / RATE, {"units": "s", "long_name": "time"}),
        **position_coordinates({"axle"}),
    }
    for response in RESPONSES.values():
        if response.paper and response.dimension not in coordinates:
            coordinates[response.dimension] = (response.dimension, np.array(response.positions))
    described = attributes(case, "replicate") | {"seed": SEED} | {key: PAPER_POINT[key] for key in PAPER_POINT}
    return xr.Dataset(variables, coordinates, described)


# --- dampers ---------------------------------------------------------------------------------------


def corner_frequencies(vehicle: Vehicle) -> dict[str, float]:
    """Frequency kappa/(2 pi C), Hz, above which a damper's joints give way, by stage."""
    return {
        stage: getattr(vehicle, f"{stage}_joint_stiffness") / 2 / (2 * np.pi * getattr(vehicle, f"{stage}_damping"))
        for stage in STAGES
    }


def dampers() -> xr.Dataset:
    """Dynamic stiffness Re D and effective damping Im D/omega of a damper between its joints, for Table I's joints.

    D = c s/(1 + c s/kappa), kappa = K_d/2: the damper alone, without the spring beside it.
    """
    case = study_case()
    vehicle = case.vehicle
    frequency = np.geomspace(0.1, 1000, 241)
    joint = np.array(TABLE_I)
    stiffness, damping, corner = [], [], []
    for stage in STAGES:
        c = getattr(vehicle, f"{stage}_damping")
        dynamic = leg_dynamic_stiffness(0.0, c, 1e6 * joint[:, None], 2j * np.pi * frequency)
        stiffness.append(dynamic.real)
        damping.append(dynamic.imag / (2 * np.pi * frequency))
        corner.append(1e6 * joint / 2 / (2 * np.pi * c))
    dims = ("stage", "joint_stiffness", "frequency")
    return xr.Dataset(
        {
            "dynamic_stiffness": (dims, np.array(stiffness), {"units": "N m-1", "long_name": "Re D"}),
            "effective_damping": (dims, np.array(damping), {"units": "N s m-1", "long_name": "Im D / omega"}),
            "corner_frequency": (dims[:2], np.array(corner), {"units": "Hz", "long_name": "kappa / (2 pi C)"}),
        },
        {
            "stage": np.array(STAGES),
            "joint_stiffness": ("joint_stiffness", joint, {"units": "MN/m", "long_name": "stiffness of each joint"}),
            "frequency": ("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
        },
        attributes(case, "replicate"),
    )
