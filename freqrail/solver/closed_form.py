"""What the closed forms share: where poles count as far, light, merging or meeting; cut-offs that are nearly equal."""

from __future__ import annotations

import numpy as np

from freqrail.model.spectrum import RationalSpectrum

EPSILON = np.finfo(float).eps

FAR = 1e7
"""Poles beyond this, rad/s, are left out unless they ring: they hold less than 1e-12 of any response (G falls like
s^-4) of a plausible vehicle; of others the check of the residues finds that something is missing."""

LIGHT = 0.05  # damping ratio below which a pole's real part is computed from the energy it dissipates
POLISHING = 12  # further steps towards poles that the first ones have not found
MERGING = 0.03  # poles of a chain closer than this, relatively, are taken for merging
MEETING = 1e-3  # a vehicle's pole closer than this to one of the spectrum's, relatively, is taken for meeting
SPREAD, SUPPORT = 0.12, 12  # half-width (relative, of the dampings) and number of the interpolation's nodes

ONE_POLE = 0.05  # cutoffs of a spectrum closer than this to their mean, relatively, are taken for merging
APART, SPECTRA = (0.06, 0.4), 9  # distances from the mean, and number, of cutoffs from which is extrapolated there

LOSS = 4e-11  # what a sum of residues is taken to lose, relative to the sum of its terms' sizes
SAFETY = 2  # of the difference between two ways to a residue


def spread(spectrum: RationalSpectrum) -> list[tuple[float, RationalSpectrum]]:
    """(weight, spectrum with two simple poles) whose weighted sum gives the mean squares of a spectrum.

    The spectrum itself, unless its cutoffs m - d and m + d are nearly one: the residues at both grow without bound and
    cancel there. But for the factor Omega_c^2 of eq. (11), a mean square is an even and smooth function of d, so that
    the value at the d in question follows from those at larger ones by a polynomial in d^2.
    """
    low, high = spectrum.cutoffs
    mean = (low + high) / 2
    if abs(high - low) / 2 > ONE_POLE * mean:
        return [(1.0, spectrum)]
    first, last = np.square(APART)
    squares = (first + last) / 2 + (last - first) / 2 * np.cos(np.pi * (np.arange(SPECTRA) + 0.5) / SPECTRA)
    here = ((high - low) / 2 / mean) ** 2
    result = []
    for x in squares:
        weight = float(np.prod([(here - z) / (x - z) for z in squares if z != x]))
        cutoffs = (mean * (1 - np.sqrt(x)), mean * (1 + np.sqrt(x)))
        result.append((weight, RationalSpectrum(spectrum.name, spectrum.roughness * (high / cutoffs[1]) ** 2, cutoffs)))
    return result
