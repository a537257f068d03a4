"""`parse_json` and `is_number_word`: all that is wrong with a text is a `ValueError`."""

from fractions import Fraction

import pytest

from ssiam.parsing import is_number_word, parse_json, parse_rate


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("[" * 100_000, id="deep"),
        pytest.param('{"a":' * 100_000, id="deep objects"),
        pytest.param("9" * 5000, id="digits"),
        pytest.param("[-" + "1" * 5000 + "]", id="digits in a list"),
        pytest.param('{"a": "\\ud800"}', id="half a surrogate pair"),
        pytest.param('{"\\uDC00": 1}', id="half a surrogate pair in a key"),
        pytest.param(b"\xff\xfe\x00", id="bytes"),
        pytest.param("", id="empty"),
        pytest.param('{"a": 1', id="cut off"),
        pytest.param("\x00", id="NUL"),
    ],
)
def test_what_is_wrong_is_a_value_error(text):
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        parse_json(text)


def test_valid_texts():
    assert parse_json('{"a": ["\\ud83d\\ude00", 1e3, null]}') == {"a": ["😀", 1e3, None]}
    assert parse_json(b"[1]") == [1]


def test_constants_can_be_refused():
    assert parse_json("[Infinity]") == [float("inf")]
    with pytest.raises(ValueError, match="Infinity is not JSON"):
        parse_json("[Infinity]", constants=False)


@pytest.mark.parametrize("word", ["7", "007", "9" * 30])
def test_number_words(word):
    assert is_number_word(word)


@pytest.mark.parametrize("word", ["", "²", "1①", "٣", "-1", "1.0", " 1", "1_0"])
def test_other_words(word):
    assert not is_number_word(word)


@pytest.mark.parametrize(
    ("text", "rate"),
    [("25", Fraction(25)), ("29.97", Fraction(2997, 100)), ("30000/1001", Fraction(30000, 1001))],
)
def test_rates(text, rate):
    assert parse_rate(text) == rate


@pytest.mark.parametrize(
    "text",
    [
        *("1e99999999", "1e-99999999", "9" * 100_000, "1/" + "9" * 5000, "1/0", "1/000"),
        *("0", "-5", "nan", "inf", "", "1e400", "٣", "1.5/3", "1e2/3"),
    ],
)
def test_other_rates(text):
    with pytest.raises(ValueError, match="is not a rate"):
        parse_rate(text)
