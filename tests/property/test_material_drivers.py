"""Drivers are exact: whatever is folded into scale and bias gives what the nodes would, one after the other."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from renderer.usd.drivers import Driver, constant, number_of, product, total, vec4_of

NUMBERS = st.floats(-2.0, 2.0, width=32)
COLOURS = st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS)
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("multiply"), COLOURS),
        st.tuples(st.just("add"), COLOURS),
        st.tuples(st.just("only"), st.integers(0, 3)),
    ),
    max_size=6,
)


def value(driver: Driver, source: tuple[float, ...]) -> np.ndarray:
    """RGBA of a driver where its source has this value, float64 [4]."""
    given_by = np.zeros(4) if driver.is_constant else np.array(source)
    if driver.channel is not None:
        given_by = np.repeat(given_by[driver.channel], 4)
    return given_by * driver.scale + driver.bias


@given(source=COLOURS, steps=STEPS, start=st.one_of(st.none(), COLOURS))
def test_folding_is_the_same_as_evaluating(
    source: tuple[float, ...], steps: list[tuple[str, object]], start: tuple[float, float, float, float] | None
) -> None:
    driver = Driver(primvar="p") if start is None else constant(start)
    plain = np.array(source if start is None else start)
    for kind, operand in steps:
        if kind == "only":
            assert isinstance(operand, int)
            driver, plain = driver.only(operand), np.repeat(plain[operand], 4)
        else:
            found = (product if kind == "multiply" else total)(constant(operand), driver)  # type: ignore[arg-type]
            assert found is not None
            driver = found
            plain = plain * operand if kind == "multiply" else plain + operand
    np.testing.assert_allclose(value(driver, source), plain, rtol=1e-9, atol=1e-9)
    as_number = source[driver.number_channel] * driver.number_scale * (not driver.is_constant) + driver.number_bias
    np.testing.assert_allclose(as_number, plain[0], rtol=1e-9, atol=1e-9)


def test_two_that_vary_have_no_driver() -> None:
    assert product(Driver(primvar="a"), Driver(primvar="b")) is None
    assert total(Driver(primvar="a"), Driver(primvar="b")) is None


@given(st.one_of(st.none(), st.text(max_size=3), st.lists(st.floats(), max_size=5), st.floats()))
def test_any_authored_value_is_finite_numbers_or_the_default(authored: object) -> None:
    assert np.isfinite(vec4_of(authored, (0.25,) * 4)).all()
    assert np.isfinite(number_of(authored, 0.25))
