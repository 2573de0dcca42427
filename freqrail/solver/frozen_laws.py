"""Resonances of blocks with laws that are not rational: hysteretic, fractional, tabulated.

Such a block has no eigenvalue problem. But around one frequency a law acts as a spring Re D beside a dashpot Im
D/omega; with its laws frozen so the block has eigenvalues, and a resonance is one whose own frequency the laws are
frozen at. It tells where peaks lie and how wide they are, which is all that quadrature needs to know.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Dashpot, Law, Parallel, Spring, Values
from freqrail.reduction.blocks import Block
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_poles import poles
from freqrail.types import Number

Complex = NDArray[np.complex128]

FREQUENCIES = np.geomspace(0.03, 3e5, 41)
"""rad/s, at which laws are frozen to begin with; a pole that lies nearer to another one is left to that."""

ROUNDS = 6  # of freezing the laws at the pole just found


def resonances_frozen(block: Block, lengths: Lengths, values: Values) -> Complex:
    """Poles of resonances, rad/s, those with Im > 0, of all vehicles of a grid: [grid..., k], -1 where there is none.

    One resonance may be told several times.
    """
    found = []
    ratio = np.sqrt(FREQUENCIES[1] / FREQUENCIES[0])
    for frequency in FREQUENCIES:
        own, frozen = _frozen(block, values, frequency)
        p = poles(own, lengths, frozen)
        near = (p.imag > frequency / ratio**1.5) & (p.imag < frequency * ratio**1.5)
        found.append(np.where(near, p, -1.0))
    shape = np.broadcast_shapes(*(each.shape for each in found))
    every = np.concatenate([np.broadcast_to(each, shape) for each in found], axis=-1)
    every = np.take_along_axis(every, np.argsort(-every.imag, axis=-1, kind="stable"), axis=-1)
    every = every[..., : max(1, int(np.max(np.sum(every.imag > 0, axis=-1), initial=1)))]
    there = every.imag > 0
    flat = {
        name: np.repeat(np.broadcast_to(v, every.shape[:-1]).ravel(), every.shape[-1]) if np.ndim(v) else v
        for name, v in values.items()
    }
    p = every.ravel()
    for _ in range(ROUNDS):
        own, frozen = _frozen(block, flat, np.where(there.ravel(), np.abs(p.imag), 1.0))
        apart = np.broadcast_to(poles(own, lengths, frozen), (p.size, 2 * block.size))
        nearest = np.argmin(np.abs(apart - p[:, None]), axis=-1)
        p = np.where(there.ravel(), np.take_along_axis(apart, nearest[:, None], axis=-1)[:, 0], -1.0)
        there &= (p.imag > 0).reshape(there.shape)
    return np.where(there, p.reshape(every.shape), -1.0)


def _frozen(block: Block, values: Values, frequency: Number) -> tuple[Block, dict[str, Number]]:
    """A block whose struts are a spring beside a dashpot each, as its laws are at a frequency in rad/s, and values."""
    result = dict(values)
    laws: dict[Law, Law] = {}
    for k, law in enumerate(dict.fromkeys(strut.law for strut in block.struts)):
        stiffness = np.asarray(law.stiffness(values, 1j * np.asarray(frequency)))
        spring, dashpot = f"frozen spring {k}", f"frozen dashpot {k}"
        result[spring], result[dashpot] = stiffness.real, stiffness.imag / frequency
        laws[law] = Parallel((Spring(spring), Dashpot(dashpot)))
    return replace(block, struts=tuple(replace(strut, law=laws[strut.law]) for strut in block.struts)), result
