# SPDX-License-Identifier: Apache-2.0
"""Samples -> intervals, noise floors and verdicts: one rule for times and for errors. Needs numpy alone.

What is compared takes turns in rounds, in a random order there and the reverse order back (A B B A, or B A A B), so that
a slow drift touches both alike, and so that which of two comes first is a coin that is thrown anew each round. Then, if
the two are equal, each round's difference is as likely negative as positive, whatever the times are: however long their
tails, however much they depend on each other, whatever else the machine does. Wilcoxon's signed-rank test needs no more
than that to be exact, and so a false verdict has the probability that is stated here.
Source  Wilcoxon 1945, "Individual Comparisons by Ranking Methods"; Hodges and Lehmann 1963, "Estimates of Location Based on
        Rank Tests"; David and Nagaraja 2003, "Order Statistics", 7.1; Fisher 1935, "The Design of Experiments" (randomization)
"""

from __future__ import annotations

import dataclasses
import functools
import math
import random
from collections.abc import Sequence
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


def reach(differences: ArrayLike) -> float:
    """How far a verdict's interval reaches from its middle: what the run's noise amounts to. Infinite with fewer than
    FEWEST_ROUNDS.

    Where disturbances are few and large, an interval may by chance leave out all of them, as the next run's will not. One
    of 99.9 % hardly can; it is scaled down to the same confidence by Student's t, and the larger of the two counts.
    """
    freedom = np.size(differences) - 1
    usual = difference(differences)
    found = max(usual.high - usual.value, usual.value - usual.low)
    wide = difference(differences, 0.999)
    if math.isfinite(wide.high):
        scale = student(1.0 - 0.5 * FALSE_VERDICTS, freedom) / student(0.9995, freedom)
        found = max(found, scale * (wide.high - wide.value), scale * (wide.value - wide.low))
    return found


def smallest_seen(reached: float, rounds: int, floor: float) -> float:
    """The smallest true difference for which a verdict would have come out with a probability of POWER.

    The interval reaches as far from its middle as FALSE_VERDICTS asks for, in units of the estimate's own deviation; the
    true difference must lie POWER's share of deviations beyond that and beyond the floor. Student's t instead of the
    normal, because the deviation itself is known from few rounds only.
    """
    if not math.isfinite(reached):
        return math.inf
    return floor + reached * (1.0 + student(POWER, rounds - 1) / student(1.0 - 0.5 * FALSE_VERDICTS, rounds - 1))


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
    smallest_seen: float  # the smallest difference that this run could have seen


def decide(differences: ArrayLike, floor: float = 0.0, resolution: float = math.inf, noise: float = 0.0) -> Verdict:
    """The one rule, for times and for errors, lower being better.

    differences: b - a, one a round: of logarithms for a ratio, or of the values themselves
    floor:       what two equal variants differ by in this run, >= 0: an A/A difference for times, what the reference's own
                 variance is worth for errors
    resolution:  the smallest difference that matters; a run that could not have seen it is undecided, not "the same"
    noise:       reach() of the run's A/A comparison, where that is known: the run could see no better than it did there
    returns:     "worse" if the whole interval lies above the floor, "better" if it lies below minus the floor
    """
    found = difference(differences)
    seen = smallest_seen(max(reach(differences), noise), np.size(differences), floor)
    if found.low > floor:
        word = WORSE
    elif found.high < -floor:
        word = BETTER
    else:
        word = SAME if seen <= resolution else UNDECIDED
    return Verdict(word, found, floor, seen)


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
    """The noise floor that an A/A comparison of a run shows: by what two equal variants came to differ."""
    return abs(difference(differences).value)


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
    floor:         of the A/A comparison, in the logarithm
    foreign_share: part of the machine's processors that others used meanwhile, 0 to 1; None: unknown
    """
    values = np.asarray(times, dtype=np.float64).ravel()
    said = []
    if floor > resolution:
        said.append(f"two equal variants differed by {100 * math.expm1(floor):.1f} %, more than the {100 * resolution:.1f} % "
                    "that matter")
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
