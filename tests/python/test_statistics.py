# SPDX-License-Identifier: Apache-2.0
"""Statistics of studies: intervals that hold what they say, false verdicts no more often than stated, differences found.

Rates are tested with fixed seeds, so a test either always holds or never does; the bounds leave a correct
implementation a chance of 1 % at most.
"""

import csv
import math
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import heddle
from heddle import statistics as s
from heddle import study_items, study_worker

RUNS = 10_000
TRACES = pathlib.Path(__file__).parent / "frame_times.csv"


def least(runs, probability):
    """The least number of `runs` independent events of that probability which comes out in 99 % of all cases or more."""
    return int(np.floor(runs * probability - 2.3263 * math.sqrt(runs * probability * (1 - probability)) - 1))


def most(runs, probability):
    return runs - least(runs, 1 - probability)


# ---- Frame times: (generator, frames) -> milliseconds ----

def recorded(name):
    with open(TRACES, newline="") as file:
        found = {row[0]: np.array(row[2:], np.float64) for row in csv.reader(file)}
    return lambda rng, frames: np.resize(np.roll(found[name], rng.integers(len(found[name]))), frames)


def heavy_tails(rng, frames):
    return 10 * np.exp(0.01 * rng.standard_t(1.5, frames))


def autocorrelated(rng, frames):
    noise, value, out = rng.normal(0, 0.01, frames), 0.0, np.empty(frames)
    for i in range(frames):
        value = out[i] = 0.98 * value + noise[i]
    return 10 * np.exp(out)


def drifting(rng, frames):
    return 10 * np.exp(np.linspace(0, rng.uniform(-0.5, 0.5), frames) + rng.normal(0, 0.01, frames))


def interrupted(rng, frames):
    """Every now and then a burst of frames takes nearly twice as long."""
    out = 10 * np.exp(rng.normal(0, 0.01, frames))
    i = 0
    while i < frames:
        i += rng.geometric(0.02)
        length = rng.geometric(0.1)
        out[i:i + length] *= 1.8
        i += length
    return out


CONDITIONS = {
    "recorded": recorded("as it is"), "recorded with a load": recorded("one processor busy"), "heavy tails": heavy_tails,
    "autocorrelated": autocorrelated, "drifting": drifting, "interrupted": interrupted,
}
ROUNDS = 10


def run(times, seed, factor=1.0):
    """A study of a, of a again, and of b, which takes `factor` times as long: differences b - a and a again - a by round."""
    b, again = [], []
    next_frame = iter(times)
    for order in s.turns(["a", "again", "b"], ROUNDS, seed):
        taken = [next(next_frame) * (factor if name == "b" else 1.0) for name in order]
        values = s.round_values(order, taken)
        b.append(values["b"] - values["a"])
        again.append(values["again"] - values["a"])
    return b, again


def verdict(b, again, matters=0.02):
    return s.decide(b, s.floor_of(again), matters)


def smallest_seen(b, again):
    return verdict(b, again).smallest_seen(s.noise([b, again], len(b)))


@pytest.mark.parametrize("condition", CONDITIONS)
def test_equal_variants_rarely_get_a_verdict_and_as_often_better_as_worse(condition):
    rng = np.random.default_rng(1)
    told = {s.BETTER: 0, s.WORSE: 0, "without floor": 0}
    for i in range(RUNS):
        b, again = run(CONDITIONS[condition](rng, 6 * ROUNDS), i)
        found = s.decide(b, s.floor_of(again))
        if found.word in told:
            told[found.word] += 1
        told["without floor"] += found.difference.low > 0 or found.difference.high < 0
    assert told[s.BETTER] + told[s.WORSE] <= most(RUNS, s.FALSE_VERDICTS)
    # The floor is extra: randomization alone must keep the promise, and not by never saying anything.
    assert 0.005 * RUNS < told["without floor"] <= most(RUNS, s.FALSE_VERDICTS)
    both = told[s.BETTER] + told[s.WORSE]
    assert abs(told[s.BETTER] - told[s.WORSE]) <= 2.5758 * math.sqrt(both) + 1


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_plant_of_one_and_a_half_of_the_smallest_difference_is_found_by_another_run(condition, sign):
    rng, runs, found = np.random.default_rng(2), 500, 0
    for i in range(runs):
        times = CONDITIONS[condition](rng, 6 * ROUNDS)
        claimed = smallest_seen(*run(times, i))
        # The same machine, other turns.
        planted = verdict(*run(times, runs + i, math.exp(1.5 * sign * claimed)))
        found += planted.word == (s.WORSE if sign > 0 else s.BETTER)
    assert found >= least(runs, s.POWER)


def test_a_slow_drift_cancels():
    # 3 % a round, without noise: nothing is left of it in any round's difference.
    for b, again in (run(10 * 1.03 ** (np.arange(6 * ROUNDS) / 6), seed) for seed in range(20)):
        assert np.abs([b, again]).max() < 1e-12
    # Whoever is always first would be told to be a better one by 0.5 %.
    straight = 10 * 1.03 ** (np.arange(2 * ROUNDS) / 2)
    assert s.decide(np.log(straight[1::2]) - np.log(straight[::2])).word == s.WORSE


def test_what_cannot_be_resolved_is_undecided_and_says_what_could_have_been_seen():
    rng = np.random.default_rng(3)
    for i in range(200):
        b, again = run(10 * np.exp(rng.normal(0, 0.3, 6 * ROUNDS)), i, factor=1.01)
        assert verdict(b, again).word != s.SAME
        assert smallest_seen(b, again) > 0.02


def test_a_run_that_could_have_seen_what_matters_says_that_there_is_no_difference():
    rng = np.random.default_rng(4)
    words = [verdict(*run(10 * np.exp(rng.normal(0, 0.003, 6 * ROUNDS)), i)).word for i in range(200)]
    assert words.count(s.SAME) >= 190


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("condition", CONDITIONS)
def test_what_matters_is_hardly_ever_called_no_difference(condition, sign):
    """Of a difference that just matters, by half of FALSE_VERDICTS; at 2 %, which quiet machines resolve, and at 20 %."""
    for matters in (0.02, 0.2):
        rng, same = np.random.default_rng(12), 0
        for i in range(2000):
            b, again = run(CONDITIONS[condition](rng, 6 * ROUNDS), i, math.exp(sign * matters))
            same += verdict(b, again, matters).word == s.SAME
        assert same <= most(2000, 0.5 * s.FALSE_VERDICTS)


def test_undecided_says_how_many_rounds_would_tell_and_they_do():
    rng, told = np.random.default_rng(13), []
    for i in range(60):
        b, again = rng.normal(0, 0.03, (2, ROUNDS))
        found, chance = s.decide(b, 0.0, 0.02), s.noise([b, again], ROUNDS)
        if found.word != s.UNDECIDED:
            continue
        needed = found.rounds_needed(chance)
        assert needed > ROUNDS
        told.append(s.decide(rng.normal(0, 0.03, needed), 0.0, 0.02).word)
    # "About": the noise itself is known from twenty differences; were it known exactly, 98 % would be told.
    assert len(told) > 30 and told.count(s.SAME) >= 0.85 * len(told)
    assert s.decide([0.0, 0.1] * 8, floor=0.03).rounds_needed(s.noise([[0.0, 0.1] * 8], 16)) is None


def test_one_disturbed_round_does_not_spoil_all_comparisons():
    """Twelve comparisons with one disturbance in one of their rounds. From 13 rounds on an interval leaves out the longest
    difference; with 7 its ends are the extreme ones, and whatever disturbs one round of a hundred must be reckoned with."""
    for rounds, least_factor, most_factor in ((7, 3.0, 6.0), (13, 0.9, 1.4), (15, 0.9, 1.2)):
        quiet = np.random.default_rng(14).normal(0, 0.03, (12, rounds))
        disturbed = quiet.copy()
        disturbed[0, 3] = 0.4
        assert least_factor < s.noise(disturbed, rounds).end / s.noise(quiet, rounds).end < most_factor


def test_a_certain_difference_that_does_not_matter_is_none():
    # Errors of images without randomness: sums in another order.
    assert s.decide([1.27e-7] * 8, matters=1e-5).word == s.SAME
    assert s.decide([-1.27e-7] * 8, matters=1e-5).word == s.SAME
    assert s.decide([-1.27e-5] * 8, matters=1e-5).word == s.BETTER
    # Nothing is left of the middle's noise but what matters.
    assert s.decide([1e-7] * 8, matters=1e-5).smallest_seen(s.noise([[1e-7] * 8], 8)) == 1e-5
    # Certain, yet perhaps too small, perhaps not.
    assert s.decide(np.linspace(0.001, 0.029, 15), matters=0.02).word == s.UNDECIDED


def test_too_few_rounds_decide_nothing():
    few = s.decide([0.5] * 6, matters=0.9)
    assert few.word == s.UNDECIDED and few.smallest_seen(s.noise([[0.5] * 6], 6)) == math.inf
    assert few.rounds_needed(s.noise([[0.5] * 6], 6)) is None
    found = s.decide([0.5, 0.5001, 0.4999, 0.5, 0.5002, 0.5, 0.4998], matters=0.01)
    assert (found.word, found.difference.low) == (s.WORSE, 0.4998)


def test_the_floor_is_no_difference():
    differences = np.linspace(0.04, 0.06, 15)
    assert s.decide(differences).word == s.WORSE
    assert s.decide(-differences).word == s.BETTER
    assert s.decide(differences, floor=0.08, matters=0.2).word == s.SAME
    assert s.decide(differences, floor=0.08, matters=0.1).word == s.UNDECIDED


def test_two_equal_variants_have_a_floor_and_are_flagged_where_they_certainly_differ():
    assert s.floor_of(np.linspace(-0.02, 0.03, 15)) == pytest.approx(0.005)
    assert s.certain_difference(np.linspace(-0.02, 0.03, 15)) == 0.0
    for certain in (np.linspace(0.01, 0.03, 15), np.linspace(-0.03, -0.01, 15)):
        assert s.certain_difference(certain) == s.floor_of(certain) == pytest.approx(0.02)
    assert s.certain_difference([0.5] * 6) == 0.0


def test_values_without_noise_are_decided_by_the_floor_and_by_what_matters():
    assert s.decide([0.0] * 8, floor=1e-4, matters=1e-3).word == s.SAME
    assert s.decide([2e-4] * 8, floor=1e-4).word == s.WORSE


def test_the_median_s_interval_holds_the_median():
    rng, held = np.random.default_rng(5), 0
    for _ in range(2000):
        interval = s.median(rng.exponential(1.0, 21))
        held += interval.low <= math.log(2) <= interval.high
        assert interval.confidence >= 0.95
    assert held >= least(2000, 0.95)
    assert s.median([3.0]) == s.Interval(3.0, 3.0, 3.0, 0.0)
    assert s.median([1.0, 2.0, 4.0]).confidence == pytest.approx(1 - 2 / 8)


def test_a_difference_s_interval_holds_the_difference():
    rng, held = np.random.default_rng(6), 0
    for _ in range(2000):
        interval = s.difference(1.0 + rng.standard_t(2, 12))
        held += interval.low <= 1.0 <= interval.high
    assert held >= least(2000, 1 - s.FALSE_VERDICTS)


def test_signed_ranks_are_distributed_as_in_the_tables():
    # n = 3: sums 0 .. 6 in 1 1 1 2 1 1 1 of 8 ways; n = 8: P(W <= 3) = 5 / 256.
    assert np.allclose(np.diff(s._signed_rank_distribution(3), prepend=0), np.array([1, 1, 1, 2, 1, 1, 1]) / 8)
    assert s._signed_rank_distribution(8)[3] == pytest.approx(5 / 256)


def test_student_s_quantiles_are_those_of_the_tables():
    for probability, freedom, quantile in ((0.975, 1, 12.7062), (0.975, 2, 4.30265), (0.99, 6, 3.14267), (0.975, 7, 2.36462),
                                           (0.99, 30, 2.45726), (0.995, 1000, 2.58075)):
        assert s.student(probability, freedom) == pytest.approx(quantile, rel=1e-5)


def test_turns_are_fair_and_come_back():
    orders = s.turns("abc", 3000, 7)
    assert all(order == order[::-1] and sorted(order[:3]) == list("abc") for order in orders)
    first = sum(order.index("a") < order.index("b") for order in orders)
    assert least(3000, 0.5) <= first <= most(3000, 0.5)
    assert s.turns("abc", 5, 7) == orders[:5]


def test_warming_up_is_seen_and_so_is_its_absence():
    rng = np.random.default_rng(8)
    steady = 10 * np.exp(rng.normal(0, 0.01, 60))
    assert s.warm_up(steady) == 0
    warming = steady * (1 + 2 * np.exp(-np.arange(60) / 4.0))
    assert 5 <= s.warm_up(warming) <= 25
    compiling = steady.copy()
    compiling[:7] = 4000
    assert 5 <= s.warm_up(compiling) <= 7
    assert s.warm_up([5.0] * 12) == 0
    assert s.warm_up(10 * 2.0 ** np.arange(60.0)) is None


def test_a_restless_machine_is_flagged():
    rng = np.random.default_rng(9)
    steady = 10 * np.exp(rng.normal(0, 0.01, 60))
    assert s.unrest(steady, 0.001, 0.02) == []
    assert "differed, by 5.1 %" in s.unrest(steady, 0.05, 0.02)[0]
    assert "drifts" in s.unrest(steady * np.linspace(1, 1.5, 60), 0.001, 0.02)[0]
    assert "interrupts" in s.unrest(np.where(np.arange(60) % 5 == 0, 2 * steady, steady), 0.001, 0.02)[0]
    assert "40 % of the processors" in s.unrest(steady, 0.001, 0.02, foreign_share=0.4)[0]


def test_the_jackknife_has_the_deviation_of_a_mean():
    parts = np.random.default_rng(10).normal(0, 1, 9)
    without = [np.delete(parts, i).mean() for i in range(9)]
    assert s.jackknife_deviation(without) == pytest.approx(parts.std(ddof=1) / 3)
    assert s.reference_floor(without) == pytest.approx(s.student(0.9875, 8) * parts.std(ddof=1) / 3)


def test_errors_of_one_technique_are_told_apart_from_the_reference_s_own_noise():
    # Two images that are equally far from the truth, against references of few samples: the same rule, with the reference's
    # floor, tells them apart no more often than stated.
    rng, false, runs = np.random.default_rng(11), 0, 2000
    truth = rng.random(64)
    bias = 0.05 * rng.permutation(np.repeat([1.0, -1.0], 32))
    images = truth + bias, truth - bias
    for _ in range(runs):
        parts = truth + rng.normal(0, 0.2, (8, 64))

        def gap(reference):
            errors = [math.sqrt(np.mean((image - reference) ** 2)) for image in images]
            return errors[1] - errors[0]

        floor = s.reference_floor([gap(np.delete(parts, i, axis=0).mean(axis=0)) for i in range(8)])
        false += s.decide([gap(parts.mean(axis=0))] * 8, floor).word in (s.BETTER, s.WORSE)
    assert false <= most(runs, s.FALSE_VERDICTS)


@pytest.mark.parametrize("call", [lambda: s.median([]), lambda: s.median([math.nan]), lambda: s.difference([]),
                                  lambda: s.difference([math.inf]), lambda: s.warm_up([1.0] * 9),
                                  lambda: s.jackknife_deviation([1.0])])
def test_numbers_are_never_made_of_nothing(call):
    with pytest.raises(ValueError):
        call()


# ---- On this machine, as it is ----

@pytest.mark.skipif(not os.environ.get("HEDDLE_TEST_ALL"), reason="minutes: scripts/test --all runs it")
def test_equal_processes_on_a_busy_machine_rarely_get_a_verdict(tmp_path, capsys):
    """20 studies of a technique against itself, in processes of its own, while another program computes."""
    point = {"graph": "studio", "settings": ["extent=[32,18]"], "keep": "ao.visibility"}
    scene = {"file": "heddle:scripts/scenes/cornell_box.py", "camera": "front", "time": 0.0, "overlays": [], "arguments": []}
    contents = study_items.Contents()
    with heddle.Host(log=lambda *_: None) as host, host.graph("studio", point["settings"]) as graph:
        made, _, files = study_worker.open_scene(host, {**scene, "file": study_items.own(scene["file"])})
        made.close()
        graph.keep("ao.visibility")
        point["expected"] = contents.of([*files, *graph.files()])
    points = [{**point, "name": name, "owner": name} for name in ("a", "again", "b")]
    load = subprocess.Popen([sys.executable, "-c", "while True: sum(range(10**6))"])
    residents = study_items.Residents(scene, None, 300, tmp_path, lambda: None, contents)
    words, needed, unrest = {clock: [] for clock in study_items.CLOCKS}, {clock: [] for clock in study_items.CLOCKS}, []
    try:
        for study in range(20):
            b, again, frames = ({clock: [] for clock in study_items.CLOCKS} for _ in range(3))
            for i, order in enumerate(s.turns(["a", "again", "b"], ROUNDS, 1000 * study)):
                found = residents.do({"do": "round", "points": points, "order": order, "frames": 1, "port": "ao.visibility"})
                for clock in study_items.CLOCKS:
                    values = s.round_values(order, [turn[0] for turn in found[clock]])
                    b[clock].append(values["b"] - values["a"])
                    again[clock].append(values["again"] - values["a"])
                    frames[clock] += [turn[0] for name, turn in zip(order, found[clock]) if name == "a"]
            for clock in study_items.CLOCKS:
                told = verdict(b[clock], again[clock], math.log1p(0.02))
                words[clock].append(told.word)
                if told.word == s.UNDECIDED:
                    needed[clock].append(told.rounds_needed(s.noise([b[clock], again[clock]], ROUNDS)) or math.inf)
            others = found["others"][0] / found["others"][1]
            unrest.append(s.unrest(frames["ms"], s.certain_difference(again["ms"]), math.log1p(0.02), others))
    finally:
        residents.close()
        load.kill()
        load.wait()
    with capsys.disabled():
        for clock, own in words.items():
            print(f"20 real A/A by {clock}, {ROUNDS} rounds: {', '.join(f'{own.count(word)} {word}' for word in sorted(set(own)))}"
                  + (f"; of these about {np.median(needed[clock]):.0f} rounds would tell (median)" if needed[clock] else ""))
        print(f"{sum(map(bool, unrest))} were flagged; the first: {unrest[0]}")
    # P(more than 3 of 20) = 0.14 % if each is false in 2.5 %; P(more than 2) = 1.3 %.
    for own in words.values():
        false = sum(word in (s.BETTER, s.WORSE) for word in own)
        chance = sum(math.comb(20, k) * s.FALSE_VERDICTS**k * (1 - s.FALSE_VERDICTS) ** (20 - k) for k in range(false, 21))
        assert chance >= 0.01, own
    assert any(unrest)  # the load was there, and was seen
