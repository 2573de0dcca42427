"""Variants: twins of a vehicle, with some of its numbers fixed, whose responses are computed beside its own.

A twin lacks the axes of what it fixes. The variables of its responses bear its name as a prefix.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

_CONTACTS = frozenset({"contact_constant", "contact_stiffness"})  # two names of one spring


@dataclass(frozen=True)
class Variant:
    """A twin. name: an identifier; "" for the vehicle itself. words: what figures and messages call the model.

    values: the numbers that it fixes by parameter, SI units; of one side or of both, as the case gives its own.
    """

    name: str
    words: str
    values: Mapping[str, float]

    @property
    def prefix(self) -> str:
        """What the names of its variables begin with."""
        return f"{self.name}_" if self.name else ""

    @property
    def fixed(self) -> frozenset[str]:
        """The parameters that do not vary in it: those of `values`, and what else says the same."""
        names = frozenset(self.values)
        return names | _CONTACTS if names & _CONTACTS else names


BASE = Variant("", "model with damper joints", {})
"""The vehicle itself, which fixes nothing."""

ITSELF = Variant("", "vehicle as the case has it", {})
"""The same of a vehicle of the free form, which may have no joints."""

TRADITIONAL = Variant(
    "traditional",
    "traditional model, rigid damper joints",
    {"primary_joint_stiffness": math.inf, "secondary_joint_stiffness": math.inf},
)
"""The paper's traditional model (fig. 1), whose damper joints are rigid."""

DEFAULT = (TRADITIONAL,)
"""The variants of a case that names none."""

PREFIXES = {model.prefix: model.words for model in (BASE, TRADITIONAL)}
"""The paper's two models: prefix of the variables of each, and the words for it."""
