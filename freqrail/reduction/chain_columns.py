"""Frequency responses of the half vehicle to one track running under its four wheels.

Two ways, which share the law of a leg (`leg_dynamic_stiffness`) and nothing else, and are each other's test:

- `system_response` solves the equations of motion of any `System`, legs equal or not;
- `chain_response` uses that a vehicle with equal legs decouples into three ladders of masses
  (bounce, pitch, bogie pitch), where each response is an elementwise expression and no equation is
  solved. It broadcasts over grids of vehicles, which is what makes a sweep fast.

Convention: e^{+i omega t}; accelerations are s^2 X of the displacement X. With a = omega L_t / v and
b = omega L_c / v the four wheels' lags (eq. 2) seen from the vehicle's centre give the chains' inputs

    bounce       (v1 + v2 + v3 + v4)/4 = cos a cos b
    pitch        (v1 + v2 - v3 - v4)/4 = i cos a sin b
    bogie pitch  (v1 - v2)/2 = i sin a e^{+ib} in front, (v3 - v4)/2 = i sin a e^{-ib} at the rear

up to the common factor exp(-i omega (L_c + L_t)/v). A response is T = B u_B + sigma P u_P + rho Q u_Q
with sigma = +1 in front and -1 at the rear, rho = +1 at a bogie's leading and -1 at its trailing axle.
Its square |T|^2 is then a sum of real columns (`lag_columns`) that depend on the speed alone, times
real powers (`column_powers`) that depend on the vehicle alone.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from freqrail.model.equations import leg_dynamic_stiffness
from freqrail.model.inputs import cos_sin
from freqrail.model.responses import CHAINS, Response
from freqrail.model.spectrum import Spectrum, frequency_psd
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.chains import STAGES, ChainResponse, chain_responses, ladder
from freqrail.types import Number

Product = tuple[Number, Number]  # real and imaginary part


LAG_COLUMNS = 7
"""Number of real functions of the wheel lags that any |T|^2 is a sum of."""


def _scale(series: Response, vehicle: Vehicle, omega: NDArray) -> Number:
    """Factor from the displacement over a leg to the response: s^2 of an acceleration, 1/arm of an angle."""
    factor: Number = -np.square(omega) if series.derivative == 2 else 1.0
    return -factor / getattr(vehicle, series.arm) if series.arm else factor


def top_products(chains: dict[str, ChainResponse]) -> dict[tuple[str, str], Product]:
    """Products X Y* of the chains' top displacements, for all that `column_powers` needs, (m/m)^2."""
    square = {chain: 1.0 / _modulus2(response.track) for chain, response in chains.items()}
    result: dict[tuple[str, str], Product] = {(chain, chain): (square[chain], 0.0) for chain in CHAINS}
    for x, y in (("bounce", "pitch"), ("bounce", "bogie_pitch"), ("pitch", "bogie_pitch")):
        # X Y* = conj(1/X) (1/Y) |X|^2 |Y|^2. As a function, because the operator may swap the factors of a
        # complex product, and with them the last bit, as the size of the arrays suits it.
        product = np.multiply(np.conj(chains[x].track), chains[y].track)
        both = square[x] * square[y]
        result[x, y] = product.real * both, product.imag * both
    return result


def column_powers(
    series: Response,
    vehicle: Vehicle,
    omega: NDArray,
    chains: dict[str, ChainResponse],
    products: dict[tuple[str, str], Product],
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """The powers of a series: (column of `lag_columns`, real array [grid..., n]), one after the other.

    |T|^2 at a position is the sum over the columns of `column_signs` x power x lag column; in
    (m/s^2)^2/m^2, (rad/s^2)^2/m^2 or m^2/m^2. No speed enters. `chains` is `chain_responses` of
    the same vehicle and omega, `products` their `top_products`. A stroke is the leg's force, which does not feel
    what is below, times its compliance, the same in all chains: the factors span few axes of the grid.
    """
    scale = np.square(_scale(series, vehicle, omega))
    if series.element in STAGES:
        leg = ladder(vehicle, "bounce")[1][STAGES.index(series.element)]
        scale = scale / _modulus2(leg_dynamic_stiffness(*leg, 1j * omega))
        elements = {chain: chains[chain].forces[series.element] for chain in series.chains}
    else:
        elements = {chain: chains[chain].ratios[series.element] for chain in series.chains}

    def factors(x: str, y: str) -> tuple[Number, Number, Number, Number]:
        real, imaginary = _times_conjugate(elements[x], elements[y])
        return scale * real, scale * imaginary, *products[x, y]

    def real_part(x: str, y: str) -> Number:
        """Re(X Y*) of the series."""
        real, imaginary, head, tail = factors(x, y)
        return real * head - imaginary * tail

    def imaginary_part(x: str, y: str) -> Number:
        """Im(X Y*) of the series."""
        real, imaginary, head, tail = factors(x, y)
        return real * tail + imaginary * head

    for chain, column in (("bounce", 0), ("pitch", 1), ("bogie_pitch", 3)):
        if chain in series.chains:
            yield column, scale * _modulus2(elements[chain]) * products[chain, chain][0]
    if "bounce" in series.chains and "pitch" in series.chains:
        yield 2, imaginary_part("bounce", "pitch")
    if len(series.chains) == 3:
        yield 4, imaginary_part("bounce", "bogie_pitch")
        yield 5, imaginary_part("pitch", "bogie_pitch")
        yield 6, real_part("pitch", "bogie_pitch") - real_part("bounce", "bogie_pitch")


def _times_conjugate(x: Number, y: Number) -> Product:
    """Real and imaginary part of x y*."""
    a, b, c, d = np.real(x), np.imag(x), np.real(y), np.imag(y)
    return a * c + b * d, b * c - a * d


def _modulus2(z: Number) -> Number:
    return np.square(np.real(z)) + np.square(np.imag(z))


def column_signs(position: tuple[int, int]) -> tuple[int, ...]:
    """The factor of each lag column at a position (sigma, rho) of a series."""
    sigma, rho = position
    return (1, sigma**2, sigma, 1, rho, rho, rho * sigma)


def lag_columns(vehicle: Vehicle, omega: NDArray, speed: NDArray) -> NDArray[np.float64]:
    """The real functions of the wheel lags (eq. 2) that |T|^2 is made of: [7, n, speeds], -.

    vehicle: single geometry (L_c and L_t as floats, m); omega [n] in rad/s; speed [m] in m/s.
    From |T|^2 = |B u_B + sigma P u_P + rho Q u_Q|^2 with a = omega L_t/v and b = omega L_c/v.
    """
    delay = np.asarray(omega)[:, None] / np.asarray(speed)
    a, b = vehicle.half_wheelbase * delay, vehicle.half_bogie_spacing * delay
    (cos_a, sin_a), (cos_b, sin_b) = cos_sin(a), cos_sin(b)
    mixed = 2 * cos_a * sin_a
    result = np.empty((LAG_COLUMNS, *a.shape))
    result[0] = np.square(cos_a * cos_b)
    result[1] = np.square(cos_a * sin_b)
    result[2] = 2 * cos_a * cos_a * cos_b * sin_b
    result[3] = sin_a * sin_a
    result[4] = mixed * cos_b * cos_b
    result[5] = mixed * sin_b * sin_b
    result[6] = mixed * cos_b * sin_b
    return result


def track_response(
    series: Response, vehicle: Vehicle, omega: NDArray, speed: Number, chains: dict[str, ChainResponse]
) -> NDArray[np.complex128]:
    """T(i omega) of a series per metre of track height under the vehicle's centre: [positions, grid..., n].

    The four wheels' responses are summed with their lags before any modulus is taken. omega [n] in
    rad/s; speed in m/s and the vehicle's fields broadcast against omega.
    """
    delay = omega / speed
    a, b = vehicle.half_wheelbase * delay, vehicle.half_bogie_spacing * delay
    scale = _scale(series, vehicle, omega)

    def part(chain: str) -> Number:
        return chains[chain].ratios[series.element] * chains[chain].top * scale if chain in series.chains else 0.0

    bounce = part("bounce") * np.cos(a) * np.cos(b)
    pitch = part("pitch") * (1j * np.cos(a) * np.sin(b))
    bogie_pitch = part("bogie_pitch") * (1j * np.sin(a))
    rows = [bounce + sigma * pitch + rho * bogie_pitch * np.exp(1j * sigma * b) for sigma, rho in series.signs]
    return np.stack(np.broadcast_arrays(*rows))


def response_psd(
    series: Response, vehicle: Vehicle, spectrum: Spectrum, frequency: NDArray, speed: Number
) -> NDArray[np.float64]:
    """One-sided PSD of a series per Hz, |T|^2 2 pi S_v(Omega)/v: [positions, grid..., n].

    frequency [n] in Hz; speed in m/s and the vehicle's fields broadcast against it. Units
    (m/s^2)^2/Hz, (rad/s^2)^2/Hz or m^2/Hz.
    """
    omega = 2 * np.pi * np.asarray(frequency)
    chains = chain_responses(vehicle, omega)
    transfer = track_response(series, vehicle, omega, speed, chains)
    return _modulus2(transfer) * frequency_psd(spectrum, frequency, speed)
