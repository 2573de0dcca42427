"""The layout of a result: which variables it has, along which dimensions, for which case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from freqrail.case.axis import Axis
from freqrail.case.case import Case
from freqrail.case.parameters import suggestion
from freqrail.errors import InputError
from freqrail.model.responses import HALF_VEHICLE, Response, Vocabulary
from freqrail.model.variants import Variant
from freqrail.result.content import Variable
from freqrail.solver.solution import METHOD, STATUS

PARAMETER = "parameter"
"""The dimension of slopes."""


@dataclass(frozen=True)
class Layout:
    """What a result holds: the responses by name, over the axes of a case, and where its spectra are, if it has any.

    gradients: the parameters by which slopes of the RMS values are stored.
    """

    case: Case
    names: tuple[str, ...]
    frequency: Axis | None
    gradients: tuple[str, ...] = ()

    def axes(self, prefix: str) -> tuple[Axis, ...]:
        """The swept parameters of the model whose variables have a prefix, in the order given."""
        return self.case.of(self.model(prefix)).axes

    @property
    def vocabulary(self) -> Vocabulary:
        """The responses that the case has."""
        return self.case.vocabulary

    def response(self, name: str) -> Response:
        """A response by name."""
        return self.vocabulary.responses[name]

    @property
    def models(self) -> tuple[Variant, ...]:
        """The vehicle itself and its variants, in the order of their variables."""
        return self.case.models

    def model(self, prefix: str) -> Variant:
        """The model whose variables have a prefix."""
        return next(model for model in self.models if model.prefix == prefix)


def variables(layout: Layout) -> dict[str, Variable]:
    """The variables of a sweep by name, in the order of the file."""
    return {name: v for model in layout.models for name, v in variables_of(layout, model.prefix).items()}


def variables_of(layout: Layout, prefix: str) -> dict[str, Variable]:
    """The variables of the model with a prefix, by name."""
    words = layout.model(prefix).words
    axes = layout.axes(prefix)
    sizes = {name: len(dimension.labels) for name, dimension in layout.vocabulary.dimensions.items()}
    sizes[PARAMETER] = len(layout.gradients)
    if layout.frequency is not None:
        sizes["frequency"] = layout.frequency.si.size
    result: dict[str, Variable] = {}

    def add(key: str, further: tuple[str, ...], dtype: type, attributes: dict[str, Any]) -> None:
        shape = (*(axis.si.size for axis in axes), *(sizes[dimension] for dimension in further))
        dims = (*(axis.name for axis in axes), *further)
        result[prefix + key] = Variable(dims, shape, np.dtype(dtype), attributes)

    for name in layout.names:
        response, place = layout.response(name), layout.vocabulary.place(name)
        meaning = f"RMS of the {response.long_name}"
        add(
            f"{name}_rms",
            place,
            float,
            {
                "units": response.unit,
                "long_name": f"{meaning}, {words}",
                "ancillary_variables": f"{prefix}{name}_rms_relative_error {prefix}status {prefix}method",
            },
        )
        error = {
            "units": "1",
            "long_name": f"estimated relative error of the computation of the {meaning}, {words}; numerical only: "
            "it says nothing of the model or of its data",
        }
        add(f"{name}_rms_relative_error", place, float, error)
    if layout.frequency is not None:
        for name in layout.names:
            response, place = layout.response(name), layout.vocabulary.place(name)
            spectrum = {
                "units": response.psd_unit,
                "long_name": f"one-sided PSD of the {response.long_name}, {words}",
            }
            add(f"{name}_psd", (*place, "frequency"), float, spectrum)
    for name in layout.names if layout.gradients else ():
        response, place = layout.response(name), layout.vocabulary.place(name)
        slope = f"slope of the RMS of the {response.long_name} by a parameter, {words}"
        unit = f"in {response.unit} over the unit that the coordinate {PARAMETER}_unit tells"
        add(f"{name}_rms_gradient", (*place, PARAMETER), float, {"long_name": slope, "comment": unit})
        error = {"long_name": f"estimated error of the {slope}, absolute; numerical only", "comment": unit}
        add(f"{name}_rms_gradient_error", (*place, PARAMETER), float, error)
    add("status", (), np.int8, flags(STATUS, f"outcome of the computation, {words}"))
    add("method", (), np.int8, flags(METHOD, f"method of the computation, {words}"))
    return result


def flags(meanings: tuple[str, ...], long_name: str) -> dict[str, Any]:
    """CF attributes of an int8 variable whose values 0, 1, ... have a meaning."""
    return {
        "long_name": long_name,
        "flag_values": np.arange(len(meanings), dtype=np.int8),
        "flag_meanings": " ".join(meanings),
    }


def response_names(responses: str | Sequence[str], vocabulary: Vocabulary = HALF_VEHICLE) -> tuple[str, ...]:
    """Names of responses from "paper", "all", "NAME,NAME" or a sequence of names, in the vocabulary's order."""
    table = vocabulary.responses
    groups = {"paper": {name for name, response in table.items() if response.paper}, "all": set(table)}
    given = [part.strip() for part in responses.split(",")] if isinstance(responses, str) else list(responses)
    known = (*groups, *table)
    unknown = [name for name in given if name not in known]
    if unknown or not given:
        raise InputError(
            *(f"--responses: unknown response {name!r}{suggestion(name, known)}" for name in unknown or [""])
        )
    wanted = set().union(*(groups.get(name, {name}) for name in given))
    return tuple(name for name in table if name in wanted)
