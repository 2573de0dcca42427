"""What decides a directional claim: a statement about RMS curves, point by point, and how often it is true.

Every test takes a `Scan`, the RMS of one response over the stiffness of one joint and the speed beside the
traditional model's, and says at which points its statement is true. The share of true points makes the verdict. All
comparisons are relative to the traditional model, so that the scale of the track's spectrum does not enter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from freqrail.names import JOINTS

HOLDS, PARTLY, FAILS = VERDICTS = ("holds", "holds partly", "does not hold")
"""What a claim can come to."""

EVERYWHERE = 0.95  # share of points from which on a claim holds: one curve may stray at a point or two
MOSTLY = 0.5  # share of points from which on it holds partly
SAME = 0.05  # relative difference up to which two curves look the same in a printed figure
SEEN = 1e-3  # relative difference from which on two curves do not coincide
STEP = 1e-6  # relative change from which on a curve rises or falls: above the numbers' own error
GREAT = 0.10  # relative difference that the paper's "great error" is taken to be
ALIKE = 0.1  # of a normalised curve, up to which two speeds follow the same law
REGION = 0.25  # of the range of speeds at either end: "low" and "high" speed

OTHER_JOINT = 5.0  # MN/m, the joint that a study of the paper keeps (section VI)
Places = dict[str, str | int]

PLACES: Places = {"car_position": "centre", "bogie": "front", "axle": 1}
"""Where a response is read unless said otherwise: the paper's z_c, z_t1 and its first axle."""


@dataclass(frozen=True)
class Scan:
    """RMS of one response against the stiffness of one joint: joint (stiffness, speed), rigid (speed), SI units."""

    joint: xr.DataArray
    rigid: xr.DataArray

    @property
    def departure(self) -> xr.DataArray:
        """Relative difference from the traditional model: (stiffness, speed)."""
        return self.joint / self.rigid - 1

    @property
    def span(self) -> xr.DataArray:
        """Largest less smallest RMS over the stiffnesses, relative to the traditional model's: (speed)."""
        return (self.joint.max("stiffness") - self.joint.min("stiffness")) / self.rigid


@dataclass(frozen=True)
class Finding:
    """What a claim came to: one of `VERDICTS`, the share of points where it is true, where that is, and the numbers."""

    verdict: str
    share: float
    where: str
    numbers: str


Outcome = tuple[xr.DataArray, str]  # where a statement is true, and the numbers that decide
Test = Callable[[Scan], Outcome]


def finding(outcome: Outcome) -> Finding:
    """The verdict of an outcome.

    A point whose RMS is NaN counts as one where the statement is not true; NaN in the outcome itself is no point.
    """
    true, numbers = outcome
    share = float(true.mean())
    counted = true.notnull()
    verdict = HOLDS if share >= EVERYWHERE else PARTLY if share >= MOSTLY else FAILS
    return Finding(verdict, share, where(true.fillna(0).astype(bool), counted), numbers)


# --- what is read off a dataset --------------------------------------------------------------------


def read(dataset: xr.Dataset, response: str, places: Places | None = None) -> Scan:
    """RMS of a response with both joints' axes and of its traditional twin, at one place on the vehicle."""
    joint, rigid = dataset[f"{response}_rms"], dataset[f"traditional_{response}_rms"]
    at = {dim: place for dim, place in (places or PLACES).items() if dim in joint.dims}
    return Scan(joint.sel(at, drop=True), rigid.sel(at, drop=True))


def scan(dataset: xr.Dataset, response: str, joint: str, places: Places | None = None) -> Scan:
    """One response against one joint's stiffness, the other joint at the paper's 5 MN/m.

    Beside it stands the traditional model, as in the paper, or the vehicle with that joint alone rigid, if the dataset
    has it (`own_rigid`): what the joint does by itself.
    """
    both = read(dataset, response, places)
    other = next(name for name in JOINTS if name != joint)
    values = both.joint.sel({other: OTHER_JOINT}, drop=True).rename({joint: "stiffness"})
    rigid = both.rigid
    if (name := own_rigid(response, joint)) in dataset:
        at = {dim: place for dim, place in (places or PLACES).items() if dim in dataset[name].dims}
        rigid = dataset[name].sel(at, drop=True)
    return Scan(values.transpose("stiffness", "speed"), rigid)


def own_rigid(response: str, joint: str) -> str:
    """The variable of a response's RMS with one joint rigid and the other at the paper's 5 MN/m."""
    return f"rigid_{joint}_{response}_rms"


def low(values: xr.DataArray) -> xr.DataArray:
    """The part of `values` at low speed: the lowest quarter of the range."""
    speed = values["speed"]
    return values.sel(speed=speed[speed <= speed.min() + REGION * (speed.max() - speed.min())])


def high(values: xr.DataArray) -> xr.DataArray:
    """The part of `values` at high speed: the highest quarter of the range."""
    speed = values["speed"]
    return values.sel(speed=speed[speed >= speed.max() - REGION * (speed.max() - speed.min())])


def everywhere(values: xr.DataArray) -> xr.DataArray:
    """All of `values`."""
    return values


Region = Callable[[xr.DataArray], xr.DataArray]


# --- the tests -------------------------------------------------------------------------------------


def below(region: Region) -> Test:
    """The model with joints has the smaller RMS."""

    def test(s: Scan) -> Outcome:
        d = region(s.departure)
        return d < -STEP, f"departure from the traditional model {extent(d)}"

    return test


def above(region: Region) -> Test:
    """The model with joints has the larger RMS."""

    def test(s: Scan) -> Outcome:
        d = region(s.departure)
        return d > STEP, f"departure from the traditional model {extent(d)}"

    return test


def same(region: Region) -> Test:
    """Both models look the same."""

    def test(s: Scan) -> Outcome:
        d = region(s.departure)
        return abs(d) <= SAME, f"departure {extent(d)}; up to {whole(SAME)} looks the same"

    return test


def differs(region: Region) -> Test:
    """The models differ visibly."""

    def test(s: Scan) -> Outcome:
        d = region(s.departure)
        return abs(d) > SAME, f"departure {extent(d)}; more than {whole(SAME)} is due"

    return test


def never_coincides(s: Scan) -> Outcome:
    """However stiff the joint, the curves stay apart."""
    d = abs(s.departure)
    return d > SEEN, f"smallest distance {extreme(d, 'min', signed=False)}"


def falls(s: Scan) -> Outcome:
    """Every step to a stiffer joint lowers the RMS."""
    step = _steps(s.joint, s.rigid)
    return step < -STEP, _change(s, "lowers")


def rises(s: Scan) -> Outcome:
    """Every step to a stiffer joint raises the RMS."""
    step = _steps(s.joint, s.rigid)
    return step > STEP, _change(s, "raises")


def more_at_low_speed(s: Scan) -> Outcome:
    """The models differ more at low speed than at high speed."""
    slow, fast = abs(low(s.departure)).mean("speed"), abs(high(s.departure)).mean("speed")
    return slow > fast, f"mean departure at low speed {extent(slow, False)}, at high speed {extent(fast, False)}"


def grows_with_speed(s: Scan) -> Outcome:
    """What the joint's stiffness changes grows with speed."""
    span = s.span
    first, last = float(span[0]), float(span[-1])
    numbers = f"softest to stiffest joint: {percent(first, False)} of the traditional RMS at {_speed(span, 0)}, "
    return _growth(span), numbers + f"{percent(last, False)} at {_speed(span, -1)}"


def same_law(s: Scan) -> Outcome:
    """At every speed the RMS runs alike from its value at the softest joint to that at the stiffest."""
    first, last = s.joint.isel(stiffness=0), s.joint.isel(stiffness=-1)
    course = ((s.joint - last) / (first - last)).isel(stiffness=slice(1, -1))
    off = abs(course - course.mean("speed"))
    numbers = "normalised from 1 at the softest to 0 at the stiffest joint, a speed's curve is off the mean by up to "
    return off <= ALIKE, f"{numbers}{float(off.max()):.2g} ({_place(off, 'max')}); {ALIKE:g} passes as the same"


def approaches(region: Region) -> Test:
    """Every step to a stiffer joint brings the model with joints nearer to the traditional one."""

    def test(s: Scan) -> Outcome:
        d = region(abs(s.departure))
        softest, stiffest = d.isel(stiffness=0), d.isel(stiffness=-1)
        numbers = f"distance {extent(softest, False)} with the softest, {extent(stiffest, False)} with the stiffest"
        return d.diff("stiffness") < 0, f"{numbers} joint"

    return test


def recedes(s: Scan) -> Outcome:
    """The softer the joint, the nearer the two models."""
    d = abs(s.departure)
    softest, stiffest = d.isel(stiffness=0), d.isel(stiffness=-1)
    numbers = f"distance {extent(softest, False)} with the softest, {extent(stiffest, False)} with the stiffest joint"
    return d.diff("stiffness") > 0, numbers


def slowly(s: Scan) -> Outcome:
    """Over the upper half of the stiffnesses hardly anything changes any more."""
    upper = s.departure.isel(stiffness=slice(s.departure.sizes["stiffness"] // 2, None))
    change = upper.isel(stiffness=-1) - upper.isel(stiffness=0)
    stiff = upper["stiffness"].values
    numbers = f"from {stiff[0]:g} to {stiff[-1]:g} MN/m the departure changes by {extent(change)}"
    return abs(change) <= SAME, f"{numbers}; up to {whole(SAME)} counts as slow"


def arrives(region: Region) -> Test:
    """With the stiffest joint the two models look the same."""

    def test(s: Scan) -> Outcome:
        d = region(s.departure.isel(stiffness=-1))
        stiffest = f"{float(s.departure['stiffness'][-1]):g} MN/m"
        return abs(d) <= SAME, f"departure at {stiffest} {extent(d)}; up to {whole(SAME)} looks the same"

    return test


def turns_away(s: Scan) -> Outcome:
    """With a stiffer joint the distance from the traditional model first shrinks, then grows."""
    nearest, after = _turn(s)
    soft = abs(s.departure).isel(stiffness=0)
    numbers = f"nearest by {extent(nearest, False)}, then away again by {extent(after, False)} of the traditional RMS"
    return (soft - nearest > SEEN) & (after > SEEN), numbers


def turns_away_more_with_speed(s: Scan) -> Outcome:
    """That moving away grows with speed."""
    _, after = _turn(s)
    numbers = f"away again by {percent(float(after[0]), False)} at {_speed(after, 0)}, "
    numbers += f"{percent(float(after[-1]), False)} at {_speed(after, -1)}"
    return _growth(after) & (after.isel(speed=slice(1, None)) > SEEN), numbers


def _turn(s: Scan) -> tuple[xr.DataArray, xr.DataArray]:
    """Smallest distance from the traditional model over the stiffnesses, and how much larger the last one is."""
    d = abs(s.departure)
    nearest = d.min("stiffness")
    return nearest, d.isel(stiffness=-1) - nearest


def _steps(joint: xr.DataArray, rigid: xr.DataArray) -> xr.DataArray:
    return joint.diff("stiffness") / rigid


def _growth(values: xr.DataArray) -> xr.DataArray:
    return values.diff("speed") > 0


def _change(s: Scan, verb: str) -> str:
    total = (s.joint.isel(stiffness=-1) - s.joint.isel(stiffness=0)) / s.rigid
    step = _steps(s.joint, s.rigid)
    opposite = step.where(step > 0) if verb == "lowers" else step.where(step < 0)
    numbers = f"softest to stiffest joint: {extent(total)} of the traditional RMS"
    if not bool(opposite.notnull().any()):
        return numbers
    return f"{numbers}; largest step the other way {extreme(opposite, 'max' if verb == 'lowers' else 'min')}"


# --- words -----------------------------------------------------------------------------------------


def plural(verdict: str, count: int) -> str:
    """A verdict as a verb of so many claims: "30 hold", "1 holds"."""
    return verdict if count == 1 else {HOLDS: "hold", PARTLY: "hold partly", FAILS: "do not hold"}[verdict]


def percent(value: float, signed: bool = True) -> str:
    """A ratio in per cent, two significant digits below ten."""
    number = 100 * value
    digits = 0 if abs(number) >= 99.5 else 1 if abs(number) >= 0.95 else 2
    return f"{number:{'+' if signed else ''}.{digits}f} %".replace("-", "−")


def whole(limit: float) -> str:
    """A limit of this module in per cent, as it was chosen."""
    return f"{100 * limit:g} %"


def extent(values: xr.DataArray, signed: bool = True) -> str:
    """Smallest and largest of `values` in per cent, each with its place."""
    if not bool(values.notnull().any()):
        return "no number"
    if values.size == 1:
        return percent(float(values), signed)
    return f"{extreme(values, 'min', signed)} to {extreme(values, 'max', signed)}"


def extreme(values: xr.DataArray, which: str, signed: bool = True) -> str:
    """The "min" or "max" of `values` in per cent with its place."""
    if not bool(values.notnull().any()):
        return "none"
    place = _place(values, which)
    return percent(float(getattr(values, which)()), signed) + (f" ({place})" if place else "")


def _place(values: xr.DataArray, which: str) -> str:
    """Where `values` have their "min" or "max"."""
    if not bool(values.notnull().any()):
        return "no number"
    flat = {"min": np.nanargmin, "max": np.nanargmax}[which](values.values)
    index = np.unravel_index(flat, values.shape)
    return ", ".join(_label(values, str(dim), int(i)) for dim, i in zip(values.dims, index, strict=True))


_UNITS = {"speed": " km/h", "stiffness": " MN/m"}


def _label(values: xr.DataArray, dim: str, index: int) -> str:
    value = values[dim].values[index]
    return f"{value:g}{_UNITS[dim]}" if dim in _UNITS else str(value).replace("_", " ")


def _speed(values: xr.DataArray, index: int) -> str:
    return _label(values, "speed", index)


def where(true: xr.DataArray, counted: xr.DataArray) -> str:
    """Where a statement is true, in words: speeds by stiffness or response; the exceptions where those are fewer."""
    found, points = int(true.sum()), int(counted.sum())
    if found == points:
        return "at every point"
    if not found:
        return "nowhere"
    words = _regions(true) if found <= MOSTLY * points else f"all but {_regions(~true & counted)}"
    return f"at {found} of {points}: {words}"


def _regions(true: xr.DataArray) -> str:
    """Points as text, rows with the same speeds together."""
    rows = [str(dim) for dim in true.dims if dim != "speed"]
    if not rows:
        return _ranges(true)
    if len(rows) > 1:  # too many to name each
        counts = true.sum([dim for dim in true.dims if dim != rows[0]])
        labels = (f"{_label(true, rows[0], i)} at {int(n)}" for i, n in enumerate(counts.values) if n)
        return "; ".join(labels)
    by_speeds: dict[str, list[str]] = {}
    for i in range(true.sizes[rows[0]]):
        line = true.isel({rows[0]: i})
        if bool(line.any()):
            by_speeds.setdefault(_ranges(line) if line.ndim else "", []).append(_label(true, rows[0], i))
    # the unit once: "1, 5 MN/m" rather than "1 MN/m, 5 MN/m"
    groups = {speeds: _listed(labels) for speeds, labels in by_speeds.items()}
    return "; ".join(f"{labels} at {speeds}" if speeds else labels for speeds, labels in groups.items())


def _listed(labels: list[str]) -> str:
    *first, last = labels
    return f"{', '.join(label.removesuffix(_UNITS['stiffness']) for label in first)} and {last}" if first else last


def _ranges(line: xr.DataArray) -> str:
    """The speeds at which `line` is true, as ranges."""
    values = line["speed"].values
    if bool(line.all()):
        return "all speeds"
    true = np.concatenate([[False], line.values.astype(bool), [False]])
    edges = np.flatnonzero(np.diff(true.astype(int)))
    pairs = zip(edges[::2], edges[1::2] - 1, strict=True)
    texts = [f"{values[a]:g}" if a == b else f"{values[a]:g}-{values[b]:g}" for a, b in pairs]
    return f"{', '.join(texts)} km/h"
