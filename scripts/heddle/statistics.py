# SPDX-License-Identifier: Apache-2.0
"""Samples -> intervals, noise floors and verdicts: one rule for times and for errors. Needs numpy alone.

What is compared takes turns in rounds, in a random order there and the reverse order back (A B B A, or B A A B), so that
a slow drift touches both alike, and so that which of two comes first is a coin that is thrown anew each round. Then, if
the two are equal, each round's difference is as likely negative as positive, whatever the times are: however long their
tails, however much they depend on each other, however the machine changes from turn to turn. Wilcoxon's signed-rank test needs no more
than that to be exact, and so a false verdict has the probability that is stated here.

A verdict asks two questions, whether there is a difference and whether it matters, and a certain answer to the first is none to
the second: of errors without randomness every difference is certain, the rounding of a last bit too. So a difference that is too
small to matter is never "better", and "no difference seen" is said of what certainly matters not: an equivalence test, whose
interval lies within what matters on both sides.
Source  Wilcoxon 1945, "Individual Comparisons by Ranking Methods"; Hodges and Lehmann 1963, "Estimates of Location Based on
        Rank Tests"; David and Nagaraja 2003, "Order Statistics", 7.1; Fisher 1935, "The Design of Experiments" (randomization);
        Schuirmann 1987, "A Comparison of the Two One-Sided Tests Procedure and the Power Approach for Assessing the Equivalence
        of Average Bioavailability"; Efron 1979, "Bootstrap Methods: Another Look at the Jackknife"
"""

from __future__ import annotations

import dataclasses
import functools
import math
import random
from collections.abc import Sequence
from statistics import NormalDist
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Of verdicts "better" and "worse" where there is no difference, both together.
FALSE_VERDICTS = 0.025
# With which the smallest difference that could be seen would have been seen.
POWER = 0.99
# The fewest rounds that can give a verdict: 2 / 2^7 is below FALSE_VERDICTS.
FEWEST_ROUNDS = 7

BETTER, WORSE, SAME, UNDECIDED = "better", "worse", "no difference seen", "undecided"
Name = TypeVar("Name")


@dataclasses.dataclass(frozen=True)
class Interval:
    """A value with the interval that holds the true one with a probability of `confidence`."""

    value: float
    low: float
    high: float
    confidence: float


def median(samples: ArrayLike, confidence: float = 0.95) -> Interval:
    """The median and the narrowest symmetric pair of order statistics that holds the true one.

    samples: at least one, finite, independent of each other
    returns: with fewer than six samples all of them, and what that is worth: 1 - 2 P(B < k), B binomial(n, 1/2)
    """
    values = np.sort(np.asarray(samples, dtype=np.float64).ravel())
    n = len(values)
    if n == 0 or not np.all(np.isfinite(values)):
        raise ValueError("a median needs at least one sample, all of them finite")
    k, below = 1, 0.5**n
    while 2 * (k + 1) <= n:
        more = below + math.comb(n, k) * 0.5**n
        if 1.0 - 2.0 * more < confidence:
            break
        k, below = k + 1, more
    # Of one sample nothing is known but itself.
    return Interval(float(np.median(values)), float(values[k - 1]), float(values[n - k]), max(0.0, 1.0 - 2.0 * below))


@functools.lru_cache(maxsize=None)
def _signed_rank_distribution(n: int) -> NDArray[np.float64]:
    """P(W <= w), w = 0 .. n (n + 1) / 2, of the sum of the ranks of n differences that are positive, if signs are coins."""
    ways = np.zeros(n * (n + 1) // 2 + 1)
    ways[0] = 1.0
    for rank in range(1, n + 1):
        shifted = np.zeros_like(ways)
        shifted[rank:] = ways[:-rank]
        ways = 0.5 * (ways + shifted)
    return np.cumsum(ways)


@functools.lru_cache(maxsize=None)
def _walsh_bound(n: int, confidence: float) -> int:
    """How many of the n (n + 1) / 2 sorted Walsh averages lie outside of the interval on each side; -1: no interval."""
    inside = np.nonzero(_signed_rank_distribution(n) <= 0.5 * (1.0 - confidence) * (1 + 1e-12))[0]
    return int(inside[-1]) if len(inside) else -1


@functools.lru_cache(maxsize=None)
def _pairs(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(n)


def difference(differences: ArrayLike, confidence: float = 1.0 - FALSE_VERDICTS) -> Interval:
    """The middle of paired differences (Hodges and Lehmann: the median of the means of all pairs) with the interval that
    inverts the signed-rank test.

    differences: one a round, finite. Fewer than FEWEST_ROUNDS of them make an interval without ends
    """
    d = np.asarray(differences, dtype=np.float64).ravel()
    if len(d) == 0 or not np.all(np.isfinite(d)):
        raise ValueError("a difference needs at least one round, all of them finite")
    first, second = _pairs(len(d))
    means = np.sort(0.5 * (d[first] + d[second]))
    value = float(np.median(means))
    k = _walsh_bound(len(d), confidence)
    if k < 0:
        return Interval(value, -math.inf, math.inf, 1.0)
    reached = 1.0 - 2.0 * float(_signed_rank_distribution(len(d))[k])
    return Interval(value, float(means[k]), float(means[-1 - k]), reached)


@dataclasses.dataclass(frozen=True)
class Noise:
    """How far from the truth a run of so many rounds ends by chance; in POWER of all runs no farther, on either side."""

    end: float  # the interval's end on the side of no difference
    middle: float
    rounds: int


DRAWN_RUNS = 1000
# Beyond it runs are drawn of so many rounds, and the rest is a root's: intervals need the means of all pairs.
MOST_DRAWN_ROUNDS = 40


def noise(comparisons: Sequence[ArrayLike], rounds: int) -> Noise:
    """What chance does to comparisons of a run, all of them taken together, since they took turns on one machine.

    One comparison of few rounds says little about rare disturbances: with 7 rounds a single one that met a disturbance would
    make all others look hopeless, and one that met none would promise too much. So the residuals of all comparisons about their
    own middles are one pool, from which runs are drawn, each residual with a coin's sign (bootstrap). What is drawn from few is
    too narrow: it is widened as Student's t is against the normal.

    comparisons: paired differences of each, one a round
    returns:     infinite with fewer than FEWEST_ROUNDS rounds, or without two residuals
    """
    usable = [np.asarray(each, dtype=np.float64).ravel() for each in comparisons]
    usable = [each for each in usable if len(each) > 1]
    freedom = sum(map(len, usable)) - len(usable)
    if rounds < FEWEST_ROUNDS or freedom < 1:
        return Noise(math.inf, math.inf, rounds)
    pool = np.concatenate([each - difference(each).value for each in usable])
    drawn = min(rounds, MOST_DRAWN_ROUNDS)
    random_ = np.random.default_rng(0)
    runs = random_.choice(pool, (DRAWN_RUNS, drawn)) * random_.choice([-1.0, 1.0], (DRAWN_RUNS, drawn))
    first, second = _pairs(drawn)
    k, count = _walsh_bound(drawn, 1.0 - FALSE_VERDICTS), len(first)
    means = np.partition(0.5 * (runs[:, first] + runs[:, second]), sorted({k, (count - 1) // 2, count // 2, count - 1 - k}), axis=1)
    # Residuals about middles of their own are smaller than what they are of.
    narrow = math.sqrt(len(pool) / freedom)
    scale = student(POWER, freedom) / NormalDist().inv_cdf(POWER) * narrow * math.sqrt(drawn / rounds)
    ends = np.concatenate([-means[:, k], means[:, -1 - k]])  # the truth is 0, and both sides are alike
    middles = 0.5 * (means[:, (count - 1) // 2] + means[:, count // 2])
    return Noise(scale * float(np.quantile(ends, POWER)), scale * float(np.quantile(np.concatenate([middles, -middles]), POWER)),
                 rounds)


@functools.lru_cache(maxsize=None)
def student(probability: float, freedom: int) -> float:
    """Quantile of Student's t for a probability above 1/2, by bisection of its distribution function, which is a sum for
    whole degrees of freedom (Abramowitz and Stegun 1964, 26.7.3 and 26.7.4)."""

    def within(t: float) -> float:  # P(|T| < t)
        theta = math.atan2(t, math.sqrt(freedom))
        cos2 = math.cos(theta) ** 2
        if freedom % 2 == 0:
            term = total = 1.0
            for j in range(1, freedom // 2):
                term *= cos2 * (2 * j - 1) / (2 * j)
                total += term
            return math.sin(theta) * total
        if freedom == 1:
            return 2.0 * theta / math.pi
        term = total = math.cos(theta)
        for j in range(1, (freedom - 1) // 2):
            term *= cos2 * (2 * j) / (2 * j + 1)
            total += term
        return 2.0 / math.pi * (theta + math.sin(theta) * total)

    wanted, low, high = 2.0 * probability - 1.0, 0.0, 1e6
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if within(middle) < wanted else (low, middle)
    return 0.5 * (low + high)


@dataclasses.dataclass(frozen=True)
class Verdict:
    """What is known of b against a, lower being better."""

    word: str  # BETTER, WORSE, SAME or UNDECIDED
    difference: Interval  # b - a
    floor: float  # a difference up to this is none: two equal variants differ by as much
    matters: float  # the smallest difference that matters

    def smallest_seen(self, chance: Noise) -> float:
        """The smallest true difference that would have come out as better or worse with a probability of POWER: the interval's
        near end must lie beyond the floor, and its middle beyond what matters."""
        return max(self.floor + chance.end, self.matters + chance.middle)

    def rounds_needed(self, chance: Noise) -> int | None:
        """About how many rounds would have told, if there is no difference, that there is none that matters: noise, and a floor
        that is noise, fall with their root. None if nothing matters, or too little is known of the noise."""
        if self.matters <= 0.0 or not math.isfinite(chance.end):
            return None
        return max(FEWEST_ROUNDS, math.ceil(chance.rounds * ((chance.end + self.floor) / self.matters) ** 2))


def decide(differences: ArrayLike, floor: float = 0.0, matters: float = 0.0) -> Verdict:
    """The one rule, for times and for errors, lower being better.

    differences: b - a, one a round: of logarithms for a ratio, or of the values themselves
    floor:       what two equal variants differ by in this run, >= 0: an A/A difference for times, what the reference's own
                 variance is worth for errors
    matters:     the smallest difference that matters, >= 0
    returns:     "worse" if the whole interval lies above the floor and its middle is as large as matters, "better" if it is so
                 below 0; "no difference seen" if the interval, with the floor on both sides, lies within what matters; else
                 "undecided"
    Where there is no difference, better and worse have a probability of FALSE_VERDICTS together; where there is one that
    matters, "no difference seen" has half of that, if noise is symmetric about it.
    """
    found = difference(differences)
    if found.low > floor and found.value >= matters:
        word = WORSE
    elif found.high < -floor and found.value <= -matters:
        word = BETTER
    else:
        word = SAME if max(found.high, -found.low) + floor <= matters else UNDECIDED
    return Verdict(word, found, floor, matters)


# ---- Turns ----

def turns(names: Sequence[Name], rounds: int, seed: int) -> list[list[Name]]:
    """For each round the order in which they take turns: a random order, and the same back. The coin that statistics
    above rest on is thrown here."""
    coin = random.Random(seed)
    orders = []
    for _ in range(rounds):
        there = list(names)
        coin.shuffle(there)
        orders.append(there + there[::-1])
    return orders


def round_values(order: Sequence[Name], times: Sequence[float]) -> dict[Name, float]:
    """The mean of the logarithms of a round's two turns of each. A drift that is straight over the round, in the logarithm,
    adds the same to all of them.

    order: of `turns`; times: one a turn, > 0
    """
    values: dict[Name, float] = {}
    for name, time in zip(order, times):
        values[name] = values.get(name, 0.0) + 0.5 * math.log(time)
    return values


def floor_of(differences: ArrayLike) -> float:
    """The noise floor that an A/A comparison of a run shows: by what two equal variants came to differ. The coin knows nothing
    of what stays with a process for a while, such as a busy processor that it was put on."""
    return abs(difference(differences).value)


def certain_difference(differences: ArrayLike) -> float:
    """By what two equal variants differed, if that is certain; else 0: noise alone shows some difference in every run."""
    found = difference(differences)
    return abs(found.value) if found.low > 0.0 or found.high < 0.0 else 0.0


# ---- What a run is like ----

def warm_up(times: ArrayLike, window: int = 5, spread: float = 4.0) -> int | None:
    """How many frames at the beginning are not yet like the second half: the first index from which a window's median is
    within `spread` deviations of the second half's median. None: never; the frames are still changing, because the second
    half's own two halves differ by as much.

    The deviation is the median absolute one (x 1.4826: a normal distribution's own) of the second half's halves about
    their own medians, at least 1 % of the median, so that a run that hardly varies does not wait for nothing.
    """
    values = np.asarray(times, dtype=np.float64).ravel()
    if len(values) < 2 * window:
        raise ValueError(f"a warm-up of {len(values)} frames: at least {2 * window} are needed")
    rest = values[len(values) // 2:]
    middle = float(np.median(rest))
    parts = np.array_split(rest, 2)
    residuals = np.concatenate([part - np.median(part) for part in parts])
    deviation = max(1.4826 * float(np.median(np.abs(residuals))), 0.01 * abs(middle))
    if abs(float(np.median(parts[1]) - np.median(parts[0]))) > spread * deviation:
        return None
    for start in range(len(values) // 2 + 1):
        if abs(float(np.median(values[start:start + window])) - middle) <= spread * deviation:
            return start
    return None


def unrest(times: ArrayLike, floor: float, resolution: float, foreign_share: float | None = None) -> list[str]:
    """What speaks against a run's machine, in words; empty: nothing. Says, and decides nothing: the verdict's interval is
    as wide as the machine is restless.

    times:         of one variant, in the order in which they were taken
    floor:         certain_difference() of the A/A comparison, in the logarithm
    foreign_share: part of the machine's processors that others used meanwhile, 0 to 1; None: unknown
    """
    values = np.asarray(times, dtype=np.float64).ravel()
    said = []
    if floor > resolution:
        said.append(f"two equal variants certainly differed, by {100 * math.expm1(floor):.1f} %, and {100 * resolution:.1f} % "
                    "matter")
    third = len(values) // 3
    if third >= 5:
        first, last = float(np.median(values[:third])), float(np.median(values[-third:]))
        if abs(math.log(last / first)) > 0.1:
            said.append(f"frames of the last third took {100 * (last / first - 1):+.0f} % against the first third: the "
                        "machine drifts")
    middle = float(np.median(values))
    share = float(np.mean(values > 1.5 * middle))
    if share > 0.1:
        said.append(f"{100 * share:.0f} % of the frames took more than 1.5 times the median: something interrupts")
    if foreign_share is not None and foreign_share > 0.1:
        said.append(f"other programs used {100 * foreign_share:.0f} % of the processors meanwhile")
    return said


# ---- Errors against a reference that is itself an estimate ----

def jackknife_deviation(without: ArrayLike) -> float:
    """Standard deviation of a figure that was computed from k independent parts of a reference, from the k figures that
    each leave one part out (Quenouille 1956, Tukey 1958): sqrt((k - 1) / k sum (figure - mean)^2)."""
    figures = np.asarray(without, dtype=np.float64).ravel()
    k = len(figures)
    if k < 2:
        raise ValueError("the variance of a reference needs at least two parts")
    return float(np.sqrt((k - 1) / k * np.sum((figures - figures.mean()) ** 2)))


def reference_floor(without: ArrayLike) -> float:
    """By how much a difference of errors may be off because the reference is an estimate, with the confidence of verdicts:
    Student's t times the jackknife's deviation. `without`: the difference with each part left out in turn."""
    return student(1.0 - 0.5 * FALSE_VERDICTS, np.size(without) - 1) * jackknife_deviation(without)
