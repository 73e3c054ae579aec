# SPDX-License-Identifier: Apache-2.0
"""Models of time from knobs and resolution: what was put in is found again, errors of left-out points are those of fits
without them, and what does not fit says so."""

import itertools
import math

import numpy as np
import pytest

from heddle import cost_model
from heddle.cost_model import Sample, fit, fit_form


def samples(time, steps=(1, 2, 4, 8), directions=(1, 2, 4), extents=(1000, 4000), noise=0.0):
    generator = np.random.default_rng(3)
    found = []
    for s, d, n in itertools.product(steps, directions, extents):
        ms = time(s, d, n) * math.exp(noise * generator.normal())
        found.append(Sample({"steps": s, "directions": d}, n, ms, ms * 0.99, ms * 1.01))
    return found


def test_loops_within_loops_are_a_product():
    model, _ = fit(samples(lambda s, d, n: 2.0 + n * (1e-3 + 5e-4 * s * d)))
    assert model.form == "product" and model.error < 1e-6 and model.fits
    assert dict(zip(model.terms, model.coefficients))["N steps directions"] == pytest.approx(5e-4)
    assert model.predict({"steps": 16, "directions": 8}, 9000) == pytest.approx(2.0 + 9000 * (1e-3 + 5e-4 * 128))


def test_powers_are_found():
    model, _ = fit(samples(lambda s, d, n: 3e-3 * n**0.9 * s**0.5 * d**0.25))
    assert model.form == "power" and model.error < 1e-9
    assert cost_model.formula(model) == "t = 0.003 N^0.9 steps^0.5 directions^0.25"


def test_an_additive_time_needs_no_products():
    model = fit_form("additive", samples(lambda s, d, n: 1.0 + n * (2e-3 + 1e-4 * s + 3e-4 * d)))
    assert model.error < 1e-9
    assert cost_model.formula(model) == "t = 1 +0.002 N +0.0001 N steps +0.0003 N directions"


@pytest.mark.parametrize("form", ["additive", "product", "power"])
def test_left_out_is_what_a_fit_without_the_point_says(form):
    all_of_them = samples(lambda s, d, n: 1.5 + n * 1e-3 * (1 + s * d), noise=0.1)
    model = fit_form(form, all_of_them)
    for i, left in enumerate(all_of_them):
        without = fit_form(form, all_of_them[:i] + all_of_them[i + 1:])
        assert model.left_out[i] == pytest.approx(without.predict(left.knobs, left.pixels), rel=1e-7)


def test_choices_and_truths_are_terms_of_their_own():
    found = [Sample({"mode": mode, "steps": s}, 100, {"a": 1.0, "b": 3.0}[mode] + s, 1, 1)
             for mode in "ab" for s in (1, 2, 3, 4)]
    model = fit_form("additive", found)
    assert model.terms == ("1", "[mode=b]", "steps") and model.coefficients == pytest.approx((1.0, 2.0, 1.0))


def test_a_knob_of_zero_has_no_logarithm():
    model = fit_form("power", [Sample({"steps": s}, 100, 2.0 * math.exp(0.1 * s), 1, 1) for s in (0, 1, 2, 4, 8)])
    assert model.terms == ("1", "steps") and model.error < 1e-9
    assert cost_model.formula(model) == "t = 2 e^(0.1 steps)"


def test_what_has_no_rule_does_not_fit_and_says_so(capsys):
    generator = np.random.default_rng(1)
    wild = [Sample({"steps": s}, 100, float(generator.uniform(1, 100)), 1, 1) for s in range(1, 13)]
    found = cost_model.describe("scene", "variant", wild)
    assert not found["fits"] and found["error_percent"]["rms"] > 10
    cost_model.print_models([found])
    assert "It does not fit: more than 10 %" in capsys.readouterr().out


def test_too_few_points_make_no_model(capsys):
    found = cost_model.describe("scene", "variant", [Sample({"steps": s}, 100, s, s, s) for s in (1, 2, 3)])
    assert found["form"] is None and found["error_percent"] is None
    cost_model.print_models([found])
    assert "no model: 3 points for 2 coefficients: too few to tell how well it predicts" in capsys.readouterr().out


def test_a_point_that_alone_decides_a_term_is_named():
    found = [Sample({"steps": s, "mode": "a"}, 100, 1.0 + s, 1, 1) for s in (1, 2, 3, 4)]
    found.append(Sample({"steps": 1, "mode": "b"}, 100, 5.0, 1, 1))
    assert fit_form("additive", found).why == "one point alone decides a term: steps=1 mode=b 100 px"


def test_terms_that_these_points_do_not_tell_apart_are_said():
    together = [Sample({"a": x, "b": 2 * x}, 100, x, x, x) for x in (1, 2, 3, 4, 5, 6)]
    assert fit_form("additive", together).why == "these points do not tell its terms apart"


def test_the_table_has_a_row_for_each_sample():
    given = samples(lambda s, d, n: 2.0 + n * 1e-3 * s * d, noise=0.02)
    found = cost_model.describe("scene", "variant", given)
    assert len(found["samples"]) == len(given) and {row["pixels"] for row in found["samples"]} == {1000, 4000}
    assert all({"predicted_ms", "left_out_ms", "ms", "low", "high"} <= row.keys() for row in found["samples"])
    assert found["noise_percent"] == pytest.approx(1.0)
    assert [rival["form"] for rival in found["rivals"]] == ["additive", "product", "power"]
