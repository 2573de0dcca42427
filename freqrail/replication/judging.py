"""What decides a directional claim: a statement about RMS curves, point by point, and how often it is true.

Every test takes a `Scan`, the RMS of one response over the stiffness of one joint and the speed beside the
traditional model's, and `Thresholds`, and says at which points its statement is true. The share of true points makes
the verdict. All comparisons are relative to the traditional model; `unjudged` says what that decides. A larger
threshold never makes a statement true at some point and false at another, `region` apart, which picks the points:
`standing` relies on it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import xarray as xr

from freqrail.case.parameters import JOINTS
from freqrail.replication.thresholds import CHOSEN, Thresholds
from freqrail.replication.words import at_speed, extent, extreme, percent, place, where, whole

HOLDS, PARTLY, FAILS = VERDICTS = ("holds", "holds partly", "does not hold")
"""What a claim can come to."""

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
class Outcome:
    """Where a statement is true, the numbers that decide, in words, and the names of the thresholds that entered."""

    true: xr.DataArray
    numbers: str
    thresholds: tuple[str, ...] = ()


@dataclass(frozen=True)
class Finding:
    """What a claim came to: one of `VERDICTS`, the share of points where it is true, where that is, and the numbers."""

    verdict: str
    share: float
    where: str
    numbers: str


Test = Callable[[Scan, Thresholds], Outcome]


def verdict_of(share: float, thresholds: Thresholds = CHOSEN) -> str:
    """The verdict that a share of true points makes."""
    return HOLDS if share >= thresholds.everywhere else PARTLY if share >= thresholds.mostly else FAILS


def finding(outcome: Outcome, thresholds: Thresholds = CHOSEN) -> Finding:
    """The verdict of an outcome.

    A point whose RMS is NaN counts as one where the statement is not true; NaN in the outcome itself is no point.
    """
    true = outcome.true
    share = float(true.mean())
    found_where = where(true.fillna(0).astype(bool), true.notnull())
    return Finding(verdict_of(share, thresholds), share, found_where, outcome.numbers)


def plural(verdict: str, count: int) -> str:
    """A verdict as a verb of so many claims: "30 hold", "1 holds"."""
    return verdict if count == 1 else {HOLDS: "hold", PARTLY: "hold partly", FAILS: "do not hold"}[verdict]


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


def low(values: xr.DataArray, region: float = CHOSEN.region) -> xr.DataArray:
    """The part of `values` at low speed: the lowest `region` of the range."""
    speed = values["speed"]
    return values.sel(speed=speed[speed <= speed.min() + region * (speed.max() - speed.min())])


def high(values: xr.DataArray, region: float = CHOSEN.region) -> xr.DataArray:
    """The part of `values` at high speed: the highest `region` of the range."""
    speed = values["speed"]
    return values.sel(speed=speed[speed >= speed.max() - region * (speed.max() - speed.min())])


def everywhere(values: xr.DataArray, region: float = CHOSEN.region) -> xr.DataArray:
    """All of `values`."""
    return values


Region = Callable[[xr.DataArray, float], xr.DataArray]


def _entering(name: str, region: Region) -> tuple[str, ...]:
    return (name,) if region is everywhere else (name, "region")


# --- the tests -------------------------------------------------------------------------------------


def below(region: Region) -> Test:
    """The model with joints has the smaller RMS."""

    def test(s: Scan, t: Thresholds) -> Outcome:
        d = region(s.departure, t.region)
        return Outcome(d < -t.step, f"departure from the traditional model {extent(d)}", _entering("step", region))

    return test


def above(region: Region) -> Test:
    """The model with joints has the larger RMS."""

    def test(s: Scan, t: Thresholds) -> Outcome:
        d = region(s.departure, t.region)
        return Outcome(d > t.step, f"departure from the traditional model {extent(d)}", _entering("step", region))

    return test


def same(region: Region) -> Test:
    """Both models look the same."""

    def test(s: Scan, t: Thresholds) -> Outcome:
        d = region(s.departure, t.region)
        numbers = f"departure {extent(d)}; up to {whole(t.same)} looks the same"
        return Outcome(abs(d) <= t.same, numbers, _entering("same", region))

    return test


def differs(region: Region) -> Test:
    """The models differ visibly."""

    def test(s: Scan, t: Thresholds) -> Outcome:
        d = region(s.departure, t.region)
        numbers = f"departure {extent(d)}; more than {whole(t.same)} is needed"
        return Outcome(abs(d) > t.same, numbers, _entering("same", region))

    return test


def never_coincides(s: Scan, t: Thresholds) -> Outcome:
    """However stiff the joint, the curves stay apart."""
    d = abs(s.departure)
    return Outcome(d > t.seen, f"smallest distance {extreme(d, 'min', signed=False)}", ("seen",))


def falls(s: Scan, t: Thresholds) -> Outcome:
    """Every step to a stiffer joint lowers the RMS."""
    return Outcome(_steps(s.joint, s.rigid) < -t.step, _change(s, "lowers"), ("step",))


def rises(s: Scan, t: Thresholds) -> Outcome:
    """Every step to a stiffer joint raises the RMS."""
    return Outcome(_steps(s.joint, s.rigid) > t.step, _change(s, "raises"), ("step",))


def more_at_low_speed(s: Scan, t: Thresholds) -> Outcome:
    """The models differ more at low speed than at high speed."""
    slow, fast = (abs(part(s.departure, t.region)).mean("speed") for part in (low, high))
    numbers = f"mean departure at low speed {extent(slow, False)}, at high speed {extent(fast, False)}"
    return Outcome(slow > fast, numbers, ("region",))


def grows_with_speed(s: Scan, t: Thresholds) -> Outcome:
    """What the joint's stiffness changes grows with speed."""
    span = s.span
    first, last = float(span[0]), float(span[-1])
    numbers = f"softest to stiffest joint: {percent(first, False)} of the traditional RMS at {at_speed(span, 0)}, "
    return Outcome(_growth(span, t), numbers + f"{percent(last, False)} at {at_speed(span, -1)}", ("step",))


def same_law(s: Scan, t: Thresholds) -> Outcome:
    """At every speed the RMS runs alike from its value at the softest joint to that at the stiffest."""
    first, last = s.joint.isel(stiffness=0), s.joint.isel(stiffness=-1)
    course = ((s.joint - last) / (first - last)).isel(stiffness=slice(1, -1))
    off = abs(course - course.mean("speed"))
    numbers = "normalised from 1 at the softest to 0 at the stiffest joint, a speed's curve is off the mean by up to "
    numbers += f"{float(off.max()):.2g} ({place(off, 'max')}); {t.alike:g} passes as the same"
    return Outcome(off <= t.alike, numbers, ("alike",))


def approaches(region: Region) -> Test:
    """Every step to a stiffer joint brings the model with joints nearer to the traditional one."""

    def test(s: Scan, t: Thresholds) -> Outcome:
        d = region(abs(s.departure), t.region)
        return Outcome(d.diff("stiffness") < -t.step, _distances(d), _entering("step", region))

    return test


def recedes(s: Scan, t: Thresholds) -> Outcome:
    """The softer the joint, the nearer the two models."""
    d = abs(s.departure)
    return Outcome(d.diff("stiffness") > t.step, _distances(d), ("step",))


def slowly(s: Scan, t: Thresholds) -> Outcome:
    """Over the upper half of the stiffnesses hardly anything changes any more."""
    upper = s.departure.isel(stiffness=slice(s.departure.sizes["stiffness"] // 2, None))
    change = upper.isel(stiffness=-1) - upper.isel(stiffness=0)
    stiff = upper["stiffness"].values
    numbers = f"from {stiff[0]:g} to {stiff[-1]:g} MN/m the departure changes by {extent(change)}"
    return Outcome(abs(change) <= t.same, f"{numbers}; up to {whole(t.same)} counts as slow", ("same",))


def arrives(region: Region) -> Test:
    """With the stiffest joint the two models look the same."""

    def test(s: Scan, t: Thresholds) -> Outcome:
        d = region(s.departure.isel(stiffness=-1), t.region)
        stiffest = f"{float(s.departure['stiffness'][-1]):g} MN/m"
        numbers = f"departure at {stiffest} {extent(d)}; up to {whole(t.same)} looks the same"
        return Outcome(abs(d) <= t.same, numbers, _entering("same", region))

    return test


def turns_away(s: Scan, t: Thresholds) -> Outcome:
    """With a stiffer joint the distance from the traditional model first shrinks, then grows."""
    nearest, after = _turn(s)
    soft = abs(s.departure).isel(stiffness=0)
    numbers = f"nearest by {extent(nearest, False)}, then away again by {_none_or(after)}"
    return Outcome((soft - nearest > t.seen) & (after > t.seen), numbers, ("seen",))


def turns_away_more_with_speed(s: Scan, t: Thresholds) -> Outcome:
    """That moving away grows with speed."""
    _, after = _turn(s)
    numbers = f"away again by {percent(float(after[0]), False)} at {at_speed(after, 0)}, "
    numbers += f"{percent(float(after[-1]), False)} at {at_speed(after, -1)}"
    return Outcome(_growth(after, t) & (after.isel(speed=slice(1, None)) > t.seen), numbers, ("step", "seen"))


# --- shared ----------------------------------------------------------------------------------------


def _turn(s: Scan) -> tuple[xr.DataArray, xr.DataArray]:
    """Smallest distance from the traditional model over the stiffnesses, and how much larger the last one is."""
    d = abs(s.departure)
    nearest = d.min("stiffness")
    return nearest, d.isel(stiffness=-1) - nearest


def _none_or(after: xr.DataArray) -> str:
    if float(after.max()) == 0:
        return "nothing at any speed: the stiffest joint is the nearest"
    return f"{extent(after, False)} of the traditional RMS"


def _steps(joint: xr.DataArray, rigid: xr.DataArray) -> xr.DataArray:
    return joint.diff("stiffness") / rigid


def _growth(values: xr.DataArray, t: Thresholds) -> xr.DataArray:
    return values.diff("speed") > t.step


def _distances(d: xr.DataArray) -> str:
    softest, stiffest = d.isel(stiffness=0), d.isel(stiffness=-1)
    return f"distance {extent(softest, False)} with the softest, {extent(stiffest, False)} with the stiffest joint"


def _change(s: Scan, verb: str) -> str:
    total = (s.joint.isel(stiffness=-1) - s.joint.isel(stiffness=0)) / s.rigid
    step = _steps(s.joint, s.rigid)
    opposite = step.where(step > 0) if verb == "lowers" else step.where(step < 0)
    numbers = f"softest to stiffest joint: {extent(total)} of the traditional RMS"
    if not bool(opposite.notnull().any()):
        return numbers
    return f"{numbers}; largest step the other way {extreme(opposite, 'max' if verb == 'lowers' else 'min')}"
