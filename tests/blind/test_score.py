"""The scorer against truths and answers made by hand, where each figure is known."""

import json

import pytest

from tests.blind import score as scoring


def hidden(name, strength=4.0, ties=(), balance="M", kind="single", parameters=None):
    """A truth with one cause."""
    cause = {
        "name": name,
        "balance": balance,
        "subsystem": {"E": "electrical", "M": "mechanical", "T": "transmission"}[balance],
        "strength": strength,
        "share_by_balance": {"E": 0.0, "M": 0.0, "T": 0.0} | {balance: 1.0},
        "parameters": parameters or {},
    }
    return {"kind": kind, "variant": "", "causes": [cause], "ties": list(ties)}


def null(variant="plain"):
    return {"kind": "null", "variant": variant, "causes": [], "ties": []}


def pair(first, second):
    one, two = hidden(first, 2.0), hidden(second, 2.0)
    return {"kind": "pair", "variant": "", "causes": one["causes"] + two["causes"], "ties": []}


def named(*causes, subsystem="M", gain=None):
    """An answer that names causes: (name, ties) or (name, ties, {parameter: (value, low, high)})."""
    out = []
    for name, ties, *rest in causes:
        given = {key: {"value": v, "ci95": [low, high]} for key, (v, low, high) in (rest[0] if rest else {}).items()}
        out.append({"name": name, "balance": "M", "parameters": given, "tied_with": list(ties), "evidence": {}})
    answer = {"detected": True, "subsystem": subsystem, "causes": out, "abstained": False}
    return answer | ({"gain": {"fraction_of_achievable": gain, "ci95": [0, 1], "holdout": "b"}} if gain else {})


SILENT = {"detected": False, "subsystem": None, "causes": [], "abstained": False}
UNSURE = {"detected": True, "subsystem": "M", "causes": [], "abstained": True}


def figures(cases):
    """{name: Figure} for a list of (truth, answer)."""
    truths = {str(i): truth for i, (truth, _) in enumerate(cases)}
    answers = {str(i): answer for i, (_, answer) in enumerate(cases) if answer is not None}
    return {figure.name: figure for figure in scoring.score(truths, answers)}


def test_a_false_alarm_is_a_null_that_is_detected_or_not_answered():
    found = figures([(null(), SILENT), (null("noise"), UNSURE), (null("noise"), SILENT), (null(), None)])
    assert found["false alarms"].value == 0.5
    assert found["false alarms, plain"].value == 0.5
    assert found["false alarms, noise"].cases == 2
    assert found["false alarms"].meets is False
    assert found["answers missing"].value == 0.25


def test_detection_counts_by_strength():
    cases = [(hidden("drag", s), a) for s, a in ((0.5, SILENT), (2.0, UNSURE), (2.0, SILENT), (4.0, UNSURE))]
    found = figures([*cases, (hidden("drag", 4.0), None)])
    values = {s: found[f"detection at {s}"].value for s in ("0.5", "1", "2", "4")}
    assert values == {"0.5": 0.0, "1": None, "2": 0.5, "4": 0.5}


def test_the_top_cause_is_the_first_one_named_of_detected_cases_without_a_tie_in_the_truth():
    right, second = named(("drag", ())), named(("stribeck", ()), ("drag", ()))
    cases = [(hidden("drag"), a) for a in (right, second, SILENT, UNSURE)]
    found = figures([*cases, (hidden("drag", ties=["stribeck"]), second)])
    assert found["top-1 cause at 4"].value == pytest.approx(1 / 3)  # an answer that abstains names nothing
    assert found["top-1 cause at 4"].cases == 3


@pytest.mark.parametrize(
    "balance, said, right",
    [("M", "M", 1), ("M", "mechanical", 1), ("M", "E", 0), ("M", None, 0), ("T", "S", 1), ("E", "winding", 1)],
)
def test_a_subsystem_may_be_a_letter_or_a_word(balance, said, right):
    found = figures([(hidden("x", balance=balance), named(("x", ()), subsystem=said))])
    assert found["right subsystem"].value == right


def test_the_set_is_all_that_is_named_with_its_ties():
    found = figures(
        [
            (hidden("drag"), named(("stribeck", ["drag"]))),
            (hidden("drag"), named(("drag", ()))),
            (hidden("drag"), named(("cogging", ["stribeck", "presliding"]))),
            (hidden("drag"), UNSURE),
        ]
    )
    assert found["truth in the set"].value == 0.5
    assert found["size of the set"].value == 2.0
    assert found["size of the set"].cases == 3


def test_a_tie_is_declared_when_truth_and_rival_are_in_one_group():
    truth = hidden("drag", ties=["stribeck"])
    answers = [named(("drag", ["stribeck"])), named(("stribeck", ["drag"])), named(("drag", ())), UNSURE]
    answers.append(named(("drag", ()), ("stribeck", ())))  # both at once is not a tie
    found = figures([(truth, answer) for answer in answers])
    assert found["confusable pair declared a tie"].value == pytest.approx(2 / 5)


def test_the_first_parameter_is_compared_and_its_interval():
    truth = {"amplitude_Nm": 0.010, "periods_per_turn": 7.0}
    answers = [
        named(("cogging", (), {"amplitude_Nm": (0.0105, 0.009, 0.012), "periods_per_turn": (9.0, 8.9, 9.1)})),
        named(("cogging", (), {"amplitude_Nm": (0.008, 0.0075, 0.0085)})),
        named(("cogging", (), {"other": (1.0, 0.0, 2.0)})),
    ]
    found = figures([(hidden("cogging", parameters=truth), answer) for answer in answers])
    assert found["parameter error at 4, median"].value == pytest.approx(0.125)
    assert found["parameter error at 4, median"].cases == 2
    assert found["coverage of 95 % intervals"].value == 0.5


def test_the_error_of_a_scale_is_that_of_its_distance_from_one():
    truth = hidden("sensor_scale", 2.0, parameters={"factor": 0.98})
    found = figures([(truth, named(("sensor_scale", (), {"factor": (0.981, 0.97, 0.99)})))])
    assert found["parameter error at 2, median"].value == pytest.approx(0.05)


@pytest.mark.parametrize(
    "cause, true, given, error, cases",
    [
        ("sensor_offset", {"value": 0.02}, {"offset_A": (0.019, 0.018, 0.021)}, 0.05, 1),
        ("sensor_scale", {"factor": 0.98}, {"change": (-0.019, -0.021, -0.018)}, 0.05, 1),
        ("cable_backlash", {"gap_rad": 0.002}, {"half_gap_rad": (0.0011, 0.0009, 0.0012)}, 0.10, 1),
        ("cogging", {"amplitude_Nm": 0.05}, {"cosine_Nm": (0.03, 0, 1), "sine_Nm": (-0.04, -1, 0)}, 0.0, 0),
    ],
)
def test_other_words_for_a_size_are_understood(cause, true, given, error, cases):
    """Two components have a length, but no interval of it."""
    found = figures([(hidden(cause, parameters=true), named((cause, (), given)))])
    assert found["parameter error at 4, median"].value == pytest.approx(error, abs=1e-12)
    assert found["coverage of 95 % intervals"].cases == cases
    assert found["coverage of 95 % intervals"].value in (1.0, None)


def test_the_interval_of_an_amplitude_is_that_of_the_answers_wave():
    truth = hidden("cogging", parameters={"amplitude_Nm": 0.05})
    for high, value in ((0.06, 1.0), (0.049, 0.0)):
        answer = named(("cogging", (), {"cosine_Nm": (0.03, 0, 1), "sine_Nm": (-0.04, -1, 0)}))
        answer["causes"][0]["waves"] = {"amplitude_Nm": {"value": 0.05, "ci95": [0.04, high]}}
        assert figures([(truth, answer)])["coverage of 95 % intervals"].value == value


def test_what_sits_in_a_sensor_may_be_named():
    found = figures([(hidden("sensor_offset", balance="E"), named(("sensor_offset", ()), subsystem="sensor"))])
    assert found["right subsystem"].value == 1.0


def test_gain_is_taken_where_the_cause_is_reported_and_worse_models_everywhere():
    cases = [(hidden("drag"), named(("drag", ()), gain=g)) for g in (0.95, 0.85, 0.9)]
    found = figures([*cases, (hidden("drag"), named(("cogging", ()), gain=-0.2))])
    assert found["gain fraction, median"].value == pytest.approx(0.9)
    assert found["gain fraction, 10th percentile"].value == pytest.approx(0.86)
    assert found["extended model worse"].value == 0.25


def test_a_pair_is_exact_when_both_are_named_and_nothing_else():
    truth = pair("drag", "cogging")
    answers = [
        named(("cogging", ()), ("drag", ["stribeck"])),
        named(("drag", ())),
        named(("drag", ()), ("cogging", ()), ("sensor_lag", ())),
        named(("drag", ["cogging"])),  # one group stands for one effect
        SILENT,
    ]
    found = figures([(truth, answer) for answer in answers])
    assert found["two effects exact"].value == pytest.approx(1 / 5)
    assert found["two effects, one or more spurious"].value == pytest.approx(1 / 5)


def test_a_pair_is_matched_whichever_group_serves_whom():
    truth = pair("drag", "cogging")
    found = figures([(truth, named(("drag", ["cogging"]), ("drag", ())))])
    assert found["two effects exact"].value == 1.0


def test_outside_the_catalogue_an_answer_abstains_or_names_wrongly_or_sees_nothing():
    truth = hidden("mains_pickup", kind="outside")
    found = figures([(truth, a) for a in (UNSURE, named(("drag", ())), SILENT, UNSURE | {"detected": False})])
    assert found["outside: abstains"].value == 0.25
    assert found["outside: wrong name"].value == 0.25
    assert found["outside: detection"].value == 0.5


def test_an_effect_outside_that_looks_like_a_cause_is_not_asked_for():
    """With a cosine above 0.95 to a cause of the catalogue it cannot be known; below 0.84 it is distinguished."""
    twin, near = hidden("eddy", kind="outside", ties=["stribeck"]), hidden("eddy", kind="outside")
    twin["cosines"], near["cosines"] = {"stribeck": 0.97}, {"stribeck": 0.90}
    named_one = named(("stribeck", ()))
    found = figures([(twin, named_one), (near, named_one), (hidden("mains_pickup", kind="outside"), UNSURE)])
    assert (found["outside: wrong name"].value, found["outside: wrong name"].cases) == (0.5, 2)
    assert found["outside: abstains"].value == 0.5
    assert found["outside, apart from all: abstains"].value == 1.0
    assert found["outside, apart from all: abstains"].cases == 1


def test_intervals_are_the_published_ones():
    """Clopper-Pearson 8 of 10 and 0 of 20 (any table): 0.4439-0.9748, 0-0.1684."""
    assert scoring.share_interval(8, 10) == pytest.approx((0.4439, 0.9748), abs=1e-4)
    assert scoring.share_interval(0, 20) == pytest.approx((0.0, 0.1684), abs=1e-4)
    assert scoring.share_interval(10, 10) == pytest.approx((0.6915, 1.0), abs=1e-4)


def test_the_interval_of_a_median_is_between_the_order_statistics():
    """Ten values: ranks 2 and 9 cover the median with 0.979 (binomial table)."""
    figure = scoring.quantile("median", range(10), 0.5)
    assert (figure.value, figure.low, figure.high) == (4.5, 1.0, 8.0)


def test_the_command_reads_folders_and_prints_the_table(tmp_path, capsys):
    for folder, content in (("truth", null()), ("answers", SILENT)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "aa.json").write_text(json.dumps(content))
    out = tmp_path / "score.json"
    truth, answers = str(tmp_path / "truth"), str(tmp_path / "answers")
    scoring.main(["--truth", truth, "--answers", answers, "--json", str(out)])
    assert (
        "false alarms                               0.000  0.000 ... 0.975       1  <= 0.02" in capsys.readouterr().out
    )
    assert json.loads(out.read_text())[1]["value"] == 0.0


@pytest.mark.parametrize(
    ("cause", "true", "given", "base", "error"),
    [
        # 1.3 ohm that grow by 0.0044 ohm per kelvin of the housing: 0.00338 per kelvin, for 0.0039
        ("resistance_temperature", 0.0039, {"ohm_per_heat": 0.004394, "time_constant_s": 0.0}, "resistance_ohm",
         2 / 15),
        # winding and housing told apart: no time constant of that name, and still per kelvin
        ("resistance_temperature", 0.0039, {"ohm_per_heat": 0.00507, "winding_time_s": 10.0}, "resistance_ohm", 0.0),
        ("torque_constant_temperature", -0.002, {"per_heat": -0.00234, "time_constant_s": 0.0},
         "torque_constant_Nm_per_A", 0.1),
    ],
)  # fmt: skip
def test_a_coefficient_of_temperature_is_the_slope_over_its_base_parameter(cause, true, given, base, error):
    slope = next(iter(given))
    parameters = {name: (value, value, value) for name, value in given.items()}
    reach = (0.8 * given[slope], 1.3 * given[slope])
    parameters[slope] = (given[slope], min(reach), max(reach))
    answer = named((cause, (), parameters)) | {"evidence": {"parameters": {base: {"value": 1.3}}}}
    found = figures([(hidden(cause, balance="E", parameters={"per_K": true}), answer)])
    assert found["parameter error at 4, median"].value == pytest.approx(error, abs=1e-9)
    assert found["coverage of 95 % intervals"].value == 1.0  # both signs of the coefficient: the ends stay in order


def test_a_slope_over_the_current_squared_is_not_a_coefficient_of_temperature():
    given = {"ohm_per_heat": (0.02, 0.01, 0.03), "time_constant_s": (30.0, 30.0, 30.0)}
    answer = named(("resistance_temperature", (), given))
    answer["evidence"] = {"parameters": {"resistance_ohm": {"value": 1.3}}}
    truth = hidden("resistance_temperature", balance="E", parameters={"per_K": 0.0039})
    assert figures([(truth, answer)])["parameter error at 4, median"].cases == 0
    kelvin = named(("resistance_temperature", (), given | {"time_constant_s": (0.0, 0.0, 0.0)}))
    assert figures([(truth, kelvin)])["parameter error at 4, median"].cases == 0  # without a base parameter


def test_what_the_truth_says_of_a_gain_is_one_less_the_square_of_the_sizes_error():
    def case(true, found, name="drag", ties=()):
        given = named((name, ties, {"coefficient": (found, 0.0, 1.0)}), gain=0.99)
        return hidden(name, parameters={"coefficient": true}), given

    cases = [case(1.0, 1.0), case(1.0, 0.9), case(2.0, 1.0), case(1.0, -0.5), case(1.0, 9.0, name="presliding")]
    found = figures(cases)
    # 1, 1 - 0.1^2, 1 - 0.5^2, and 1 - 1.5^2 for a wrong sign; presliding does not grow with its size
    assert found["gain by the hidden size, median"].cases == 4
    assert found["gain by the hidden size, median"].value == pytest.approx((0.99 + 0.75) / 2)
    assert found["gain by the hidden size, 10th percentile"].value == pytest.approx(-1.25 + 0.3 * (0.75 + 1.25))
    assert found["gain fraction, median"].value == 0.99
