"""What a confirmation is to do: which points, simulated how, at what cost; every fault found before anything is run."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.axis import SAME, Axis
from freqrail.case.case import Case
from freqrail.case.described import HALF
from freqrail.case.file import parse_toml
from freqrail.case.free_tables import liked
from freqrail.case.parameters import PARAMETERS, Parameter, suggestion
from freqrail.case.quantities import parse_pair, parse_quantity
from freqrail.case.samples import SAMPLE
from freqrail.confirm import setup as confirm_setup
from freqrail.confirm import simulation, time_side
from freqrail.confirm.integrators import INTEGRATORS
from freqrail.confirm.setup import Setup
from freqrail.confirm.simulated import AnyVehicle, Simulated
from freqrail.confirm.track_record import LARGEST_SEED
from freqrail.errors import FreqrailWarning, InputError
from freqrail.model.assembled import ACCELERATED, EQUAL_POLES, IRRATIONAL, RIGID, obstacles
from freqrail.model.band import Band
from freqrail.model.equations import StateSpace
from freqrail.model.responses import Vocabulary
from freqrail.model.system import coefficients
from freqrail.model.variants import Variant
from freqrail.result.axes import grid_axis
from freqrail.result.confirmation import is_confirmation
from freqrail.result.points import Place, Point, find_place, off_grid, parse_point, read_result, result_case
from freqrail.text import given

WHOLE_AXIS_BAND = Band("frequency", 0.1, 100.0)
"""What a result without a band is confirmed over: a time run cannot take in the whole axis."""

STARTS = ("rest", "steady")
MOST_REALISATIONS = 1000

_DURATION = Parameter("duration", "confirm", "T", "s", "time", "60 s", "length of a record")
_MAX_TIME = Parameter("max_time", "confirm", "t", "s", "time", "10 min", "longest wall time of a run")

GivenPoints = str | Point | Sequence[str | Point]


@dataclass(frozen=True)
class Run:
    """What a confirmation is to do: the points, how each is simulated, where they lie on the result's grid.

    names: the responses that the result holds. models: the vehicle itself and the variants that are simulated. band:
    the one confirmed over. places: where the numbers of each point are, in the result or computed anew; labels: the
    same in words.
    """

    case: Case
    dataset: xr.Dataset
    names: tuple[str, ...]
    models: tuple[Variant, ...]
    band: Band
    places: tuple[Place, ...]
    labels: tuple[str, ...]
    points: tuple[time_side.OperatingPoint, ...]
    setups: tuple[Setup, ...]

    @property
    def labels_of_models(self) -> tuple[str, ...]:
        """What the models are called, in their order."""
        return tuple(model.name or _own(self.case) for model in self.models)

    @property
    def vocabulary(self) -> Vocabulary:
        """The responses that the vehicle has."""
        return self.case.vocabulary

    @property
    def frequency(self) -> NDArray[np.float64]:
        """Frequencies, Hz, of the spectra that the result holds: [n], none if it holds none."""
        return self.dataset["frequency"].values if "frequency" in self.dataset else np.empty(0)

    @property
    def simulated_seconds(self) -> float:
        """Seconds to be simulated in all, which `progress` is told of."""
        return sum(
            confirm_setup.simulated_seconds(point, setup, tighter=not place)
            for place, (point, setup) in enumerate(zip(self.points, self.setups, strict=True))
        )

    @property
    def stored_bytes(self) -> int:
        """Size of the confirmation in bytes, about."""
        series = self.setups[0].series
        each = 0.0
        for point, setup in zip(self.points, self.setups, strict=True):
            side = time_side.time_side(point, setup.names)
            kept = confirm_setup.HISTORY * confirm_setup.sampling_rate(point, setup, side) / confirm_setup.KEPT_EVERY
            numbers = 30 + 2 * setup.realisations + 2 * confirm_setup.PSD_LINES
            each = max(each, 2 * series * (8 * numbers + 4 * kept) + 24 * kept)
        return int(len(self.points) * each) + 2 * len(self.case.text) + 200_000

    def seconds(self, jobs: int = 1, integrator: str | None = None) -> float:
        """Estimated wall time in s on `jobs` processes, from trial runs of every point's first moments."""
        each = []
        for place, (point, setup) in enumerate(zip(self.points, self.setups, strict=True)):
            setup = replace(setup, integrator=integrator or setup.integrator)
            once = simulation.seconds(point, setup)
            if not place:
                once += simulation.seconds(point, replace(setup.tighter(), realisations=0))
            each.append(once)
        return max(max(each), sum(each) / jobs)


def prepare_run(
    result: xr.Dataset | str | os.PathLike[str],
    at: GivenPoints | None = None,
    seed: int = 0,
    realisations: int = 8,
    duration: str = "60 s",
    integrator: str = "rk45",
    start: str = "rest",
    band: str | None = None,
) -> Run:
    """The checked setup of `confirm`, whose arguments these are. Raises InputError."""
    dataset = result if isinstance(result, xr.Dataset) else read_result(result)
    if is_confirmation(dataset):
        raise InputError("confirm: this dataset is a confirmation; what it confirms, a result of a sweep, is expected")
    if "status" not in dataset:
        raise InputError("confirm: this dataset is no result of `freqrail sweep` (it has no variable status)")
    problems = _option_problems(seed, realisations, integrator, start)
    period = _quantity(_DURATION, "--duration", duration, problems)
    case = result_case(dataset)
    chosen = _band(band, problems) if band else case.band or WHOLE_AXIS_BAND
    if problems:
        raise InputError(*problems)
    names = tuple(name for name in case.vocabulary.responses if f"{name}_rms" in dataset)
    places = _places(dataset, case, at)
    labels = tuple(_label_of(place) for place in places)
    models = _models(case)
    points = tuple(_point(place, models) for place in places)
    if refused := _refusals(case, labels, points):
        raise InputError(*refused)
    simulated = tuple(model.name or _own(case) for model in models)
    rigid = _rigid(points, names)
    setups = []
    for label, point in zip(labels, points, strict=True):
        setup = Setup(
            _limits(chosen, point.speed),
            period,
            realisations,
            integrator,
            start,
            seed,
            names=names,
            models=simulated,
            rigid=rigid,
            vocabulary=case.vocabulary,
        )
        try:
            confirm_setup.check_setup(point, setup)
        except InputError as fault:
            raise InputError(*(f"confirm: {_prefix(label)}{line}" for line in fault.problems)) from None
        setups.append(setup)
    return Run(case, dataset, names, models, chosen, tuple(places), labels, points, tuple(setups))


def _limits(band: Band, speed: float) -> tuple[float, float]:
    """A band in Hz at `speed` in m/s. Not by `band_limits`, whose faults a confirmation must see."""
    return (band.low, band.high) if band.kind == "frequency" else (speed / band.high, speed / band.low)


def check_cost(run: Run, max_time: str = "10 min", jobs: int = 1) -> float:
    """The estimated wall time of a run, s. Raises InputError, with an alternative, if it exceeds `max_time`."""
    problems: list[str] = []
    limit = _quantity(_MAX_TIME, "--max-time", max_time, problems)
    if type(jobs) is not int or jobs < 1:
        problems.append(f"--jobs: must be a whole number, at least 1 {given(jobs)}")
    if problems:
        raise InputError(*problems)
    needed = run.seconds(jobs)
    if needed > limit:
        integrator = run.setups[0].integrator
        way_out = "give a smaller --duration or fewer --realisations"
        if integrator != "exponential":
            faster = run.seconds(jobs, "exponential")
            way_out = f"--integrator exponential takes about {_time(faster)}, whatever the stiffness"
        raise InputError(
            f"confirm: {integrator} would take about {_time(needed)}, more than --max-time allows "
            f'(got "{max_time}"); {way_out}'
        )
    return needed


def _time(seconds: float) -> str:
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"


def _option_problems(seed: int, realisations: int, integrator: str, start: str) -> list[str]:
    problems = []
    for name, value, low, high in (
        ("seed", seed, 0, LARGEST_SEED),
        ("realisations", realisations, 1, MOST_REALISATIONS),
    ):
        if type(value) is not int or not low <= value <= high:
            problems.append(f"--{name}: must be a whole number from {low} to {high} {given(value)}")
    for name, choice, known in (("integrator", integrator, INTEGRATORS), ("start", start, STARTS)):
        if choice not in known:
            problems.append(f"--{name}: unknown{suggestion(str(choice), known)} {given(choice)}")
    return problems


def _quantity(parameter: Parameter, option: str, text: object, problems: list[str]) -> float:
    try:
        return parse_quantity(parameter, text).value
    except ValueError as fault:
        problems.append(f"{option}: {fault}")
        return math.nan


def _band(text: str, problems: list[str]) -> Band:
    """A band from "0.1:100 Hz" or, by wavelength, "1:200 m"."""
    kind = "wavelength" if str(text).rstrip().endswith("m") else "frequency"
    try:
        low, high = parse_pair(PARAMETERS[kind], text)
    except ValueError as fault:
        problems.append(f"--band: {fault}")
        return WHOLE_AXIS_BAND
    if not low.value < high.value:
        problems.append(f"--band: the lower limit must be below the upper one {given(text)}")
    return Band(kind, low.value, high.value)


def _places(dataset: xr.Dataset, case: Case, at: GivenPoints | None) -> list[Place]:
    """Where the numbers of the points are: a point off the grid is computed anew, and a warning says so.

    Raises InputError for one that cannot be, or is given twice.
    """
    named: list[tuple[str, Point | None]]
    if at is not None:
        given_points = [at] if isinstance(at, str | Mapping) else list(at)
        named = [
            ("--at", parse_point(point, case.variable) if isinstance(point, str) else point) for point in given_points
        ]
    else:
        named = _own_points(dataset, case)
    places: list[Place] = []
    keys: list[str] = []
    problems: list[str] = []
    for origin, point in named:
        try:
            place = find_place(dataset, point, origin=origin)
        except InputError as fault:
            problems += fault.problems
            continue
        key = _point(place, ()).key
        if key in keys:
            problems.append(f"{origin} the same point as point {keys.index(key) + 1}; give each once")
        keys.append(key)
        places.append(place)
    if problems:
        raise InputError(*problems)
    for place in places:
        for line in told_of(place):
            warnings.warn(line, FreqrailWarning, stacklevel=3)
    return places


def told_of(place: Place) -> tuple[str, ...]:
    """What is warned of a point off the grid when it is found, and kept in the confirmation; nothing of another."""
    return (f"{place.note}; its number is that of the case, not of the file", *place.told) if place.anew else ()


def _own_points(dataset: xr.Dataset, case: Case) -> list[tuple[str, Point | None]]:
    """The case's own points, with what messages call them: those on the grid, or all if none is.

    `--over` may have narrowed the grid: what it has left out is warned of, and left out here too.
    """
    own = [(f"[confirm].points: point {n}:", point) for n, point in enumerate(case.points, start=1)]
    off = [(origin, point, off_grid(dataset, point, origin)[1]) for origin, point in own]
    held = [(origin, point) for origin, point, missing in off if not missing]
    for origin, _, missing in off if held else []:
        if missing:
            values = ", ".join(f"{name} = {quantity.text}" for name, quantity in missing.items())
            warnings.warn(
                f"{origin} {values} is off the grid: left out; name it with --at to have it all the same",
                FreqrailWarning,
                stacklevel=4,
            )
    return [*held] or [*own] or [("--at", None)]


def _models(case: Case) -> tuple[Variant, ...]:
    """The vehicle itself and the variants that can be simulated beside it: with wheels at its places and its speed."""
    models = []
    for model in case.models:
        places = {name for wheel in case.described.system.wheels for name in coefficients(wheel.place)}
        moved = sorted(model.fixed & {"speed", *places})
        if moved:
            warnings.warn(
                f"confirm: {model.words}: left out: it fixes {', '.join(moved)}, and the models of a confirmation "
                "share the track under their wheels",
                FreqrailWarning,
                stacklevel=4,
            )
        else:
            models.append(model)
    return tuple(models)


def _point(place: Place, models: tuple[Variant, ...]) -> time_side.OperatingPoint:
    """A point with the vehicles of the models, the first of which is the vehicle itself."""
    case = result_case(place.dataset)
    axes = tuple(_axis_of(place.dataset, axis) for axis in case.axes)

    def vehicle_of(own: Case) -> Simulated:
        index = tuple(place.index[axis.name] for axis in own.axes if axis.name != "speed")
        return own.vehicles().at(index) if own.described == HALF else _any_vehicle(own, index)

    case = replace(case, axes=axes)
    vehicle = vehicle_of(case)
    twins = tuple((model.name, vehicle_of(case.of(model))) for model in models[1:])
    values = {name: quantity.value for name, quantity in case.quantities.items()}
    values |= {name: float(grid_axis(place.dataset, name).si[i]) for name, i in place.index.items() if name != SAMPLE}
    for column in case.samples.columns if case.samples else ():  # its values, not its number, say what a sample is
        values[column.name] = float(grid_axis(place.dataset, column.name).si[place.index[SAMPLE]])
    # twelve digits: the streams must not hang on the last bit of a conversion of units
    key = ", ".join(f"{name}={values[name]:.12g}" for name in sorted(values))
    return time_side.OperatingPoint(vehicle, values["speed"], case.spectrum, key, twins, _own(case))


def _own(case: Case) -> str:
    """What the vehicle itself is called among the models."""
    return time_side.OWN if case.is_half_vehicle else time_side.OWN_FREE


def _any_vehicle(case: Case, index: tuple[int, ...]) -> AnyVehicle:
    """One vehicle of a case's grid. index: along its axes but speed."""
    system = case.described.system
    values = {name: value for name, value in case.values().items() if name in {*system.parameters}}
    shape = np.broadcast_shapes(*(np.shape(value) for value in values.values()))
    floats = {name: float(np.broadcast_to(value, shape)[index]) for name, value in values.items()}
    return AnyVehicle(system, floats, case.described.readings.outputs)


def _rigid(points: Sequence[time_side.OperatingPoint], names: tuple[str, ...]) -> tuple[str, ...]:
    """The models that newmark serves: nothing moves inside their legs, nor inside their contacts, at any point."""
    sides = [time_side.time_side(point, names) for point in points]
    return tuple(
        name
        for name in sides[0].models
        if all(_second_order(side.models[name], name not in side.rates) for side in sides)
    )


def _second_order(model: StateSpace, rates_apart: bool) -> bool:
    """Whether a model is q'' = -C q' - K q + B v and no more."""
    freedoms = sum(state.endswith("/dt") for state in model.states)
    return rates_apart and len(model.states) == 2 * freedoms and not model.b[freedoms:].any()


_WHY = {
    IRRATIONAL: (
        "no differential equation, so that nothing can be integrated in time",
        "compare by sums over lines (freqrail.confirm.crosschecks.line_rms), or give a law of springs, dashpots and "
        'inerters, such as "k | (K - c)"',
    ),
    RIGID: ("rigid", 'give a large finite stiffness in place of "inf"'),
    EQUAL_POLES: ("a law with equal poles", "change one of its numbers a little, such as by 0.1 %"),
    ACCELERATED: ("an inerter on the track", 'put a spring in series with it, as in contact = "H - (m | k | c)"'),
}
"""Why a law cannot be simulated, in words, and what to do."""


def _refusals(case: Case, labels: Sequence[str], points: Sequence[time_side.OperatingPoint]) -> list[str]:
    """A line for every reason why a vehicle cannot be simulated: which laws, where, and what to do."""
    found: dict[tuple[str, str], list[str]] = {}
    for label, point in zip(labels, points, strict=True):
        for model, vehicle in time_side.vehicles(point).items():
            if isinstance(vehicle, AnyVehicle):
                for name, why in obstacles(vehicle.system, vehicle.values).items():
                    # a law is what it is everywhere, a number may be that of one point and model
                    where = "" if why == IRRATIONAL else _prefix(label, model)
                    names = found.setdefault((where, why), [])
                    names += [] if name in names else [name]
    lines = []
    for (where, why), names in found.items():
        words, remedy = _WHY[why]
        told = [_law_words(case, name, why) for name in names]
        some = ", ".join(told[:3]) + (f" and {len(told) - 3} more" if len(told) > 3 else "")
        lines.append(f"confirm: {where}{some}: {words}; {remedy}")
    return lines


def _law_words(case: Case, name: str, why: str) -> str:
    """A leg or a wheel's contact in words, with the letters of its law that have no differential equation."""
    wheel = name in [wheel.name for wheel in case.described.system.wheels]
    words = f"contact of wheel {name}" if wheel else f"suspension {name}"
    if why != IRRATIONAL:
        return words
    tables = parse_toml(case.effective, "the result's case")["wheels" if wheel else "suspensions"]
    table = liked(tables, tables[name])
    letters = ", ".join(key for key, value in table.items() if isinstance(value, dict))
    return f"{words}, {letters}"


def _axis_of(dataset: xr.Dataset, axis: Axis) -> Axis:
    """A case's axis, or what a part of its result, or several put together, have of it."""
    own = grid_axis(dataset, axis.name)
    return axis if own.si.size == axis.si.size and np.allclose(own.si, axis.si, rtol=SAME, atol=0.0) else own


def _prefix(*where: str) -> str:
    """Where a fault is, before its words; the one point of a case without axes has no label."""
    known = ", ".join(filter(None, where))
    return f"{known}: " if known else ""


def _label_of(place: Place) -> str:
    return ", ".join(place.label(name) for name in place.index)
