"""What pictures and plots are made of: bins, rows, colours, and drawings that the page can carry."""

from __future__ import annotations

import base64
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from sgms_observer.diagnosis.report_pictures import force_over_position
from sgms_observer.effects.effect import EffectSettings
from sgms_observer.report.drawing import (
    ESTIMATE,
    Line,
    Panel,
    extreme_rows,
    one_after_another,
    sheet,
    time_plot,
    with_holes,
)
from sgms_observer.report.friction_pictures import (
    binned,
    effect_line,
    over_velocity,
    position_bins,
    residual_over_position,
    speed_ticks,
    stribeck_points,
)
from sgms_observer.report.page import COLOURS
from sgms_observer.settings.units import Units


def contrast(one: str, other: str) -> float:
    """Contrast of two colours by WCAG 2.1."""

    def luminance(colour: str) -> float:
        parts = np.array([int(colour[place : place + 2], 16) for place in (1, 3, 5)]) / 255
        linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    dark, bright = sorted([luminance(one), luminance(other)])
    return (bright + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("name", ["ink", "soft", "accent", "good", "unsure", "bad"])
@pytest.mark.parametrize("background", ["paper", "panel"])
def test_text_stands_out_light_and_dark(name: str, background: str) -> None:
    for number in (0, 1):
        assert contrast(COLOURS[name][number], COLOURS[background][number]) >= 4.5


@pytest.mark.parametrize("name", ["estimate", "measured", "reference", "forward", "backward"])
def test_lines_stand_out_light_and_dark(name: str) -> None:
    for number in (0, 1):
        assert contrast(COLOURS[name][number], COLOURS["paper"][number]) >= 3.0


def test_colours_are_told_apart_when_a_picture_becomes_the_pages() -> None:
    light = [pair[0] for pair in COLOURS.values()]
    assert len(set(light)) == len(light)


def test_a_drawing_is_xml_in_the_pages_colours_with_names_of_its_own() -> None:
    pictures = []
    for name in ("a/b", "c"):
        with sheet(name, 'a <caption> with "quotes" & more') as drawn:
            drawn.axes[0].plot([0.0, 1.0], [0.0, 1.0], "o-", color=ESTIMATE, label="<b>one</b>")
            drawn.axes[0].plot([0.0, 1.0], [1.0, 0.0], label="two")
        pictures.append(drawn.picture)
    names = []
    for picture in pictures:
        tree = ElementTree.fromstring(picture.svg)
        assert tree.attrib["aria-label"] == picture.caption
        texts = ["".join(node.itertext()) for node in tree.iter("{http://www.w3.org/2000/svg}text")]
        assert "<b>one</b>" in texts
        assert "var(--estimate)" in picture.svg and ESTIMATE not in picture.svg
        own = {node.attrib["id"] for node in tree.iter() if "id" in node.attrib}
        used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', picture.svg))
        assert used and used <= own
        names.append(own)
        assert picture.png.startswith(b"\x89PNG")
    assert not names[0] & names[1]


def test_bins_are_even_and_resolve_the_shortest_period() -> None:
    position = np.random.default_rng(1).uniform(-0.05, 0.05, 20_000)
    low, high, count = position_bins(position, None)
    assert (low, high) == (position.min(), position.max()) and count == 120
    low, high, count = position_bins(position, 0.001)
    assert high - low == pytest.approx(0.02) and count == 240
    assert position_bins(position[:100], None)[2] == 5


def test_a_bin_holds_mean_and_standard_error() -> None:
    position = np.repeat([0.5, 1.5, 2.5], [100, 50, 2])
    values = np.concatenate([np.tile([1.0, 3.0], 50), np.full(50, 7.0), [1.0, 2.0]])
    mean, error = binned(position, values, np.array([0.0, 1.0, 2.0, 3.0]))
    assert mean[:2] == pytest.approx([2.0, 7.0]) and np.isnan(mean[2])
    assert error[:2] == pytest.approx([0.1, 0.0])


def test_residual_is_drawn_for_both_directions_with_the_effect_on_it() -> None:
    position = np.tile(np.linspace(0.0, 0.05, 500), 4)
    velocity = np.repeat([1.0, -1.0], 1000)
    wave = np.sin(2.0 * np.pi * position / 0.012)
    plain = residual_over_position("a", "b", position, velocity, wave, Units())
    fitted = residual_over_position("a", "b", position, velocity, wave, Units(), wave, 0.012)
    for picture, words in ((plain, ["forward", "backward"]), (fitted, ["effect, forward", "effect, backward"])):
        for word in ("position [mm]", "residual [N]", *words):
            assert f">{word}<" in picture.svg
        assert "var(--forward)" in picture.svg and "var(--backward)" in picture.svg
    assert ">effect, forward<" not in plain.svg


def test_the_line_of_an_effect_has_no_break_where_bins_are_empty() -> None:
    """The axis passes two of four places fast: few rows there, or none."""
    places = np.concatenate([np.linspace(0.0, 0.02, 2000), [0.025], np.linspace(0.04, 0.06, 2000)])
    edges = np.linspace(0.0, 0.06, 121)

    def wave(position: np.ndarray) -> np.ndarray:
        return np.sin(2.0 * np.pi * position / 0.004)

    assert np.isnan(binned(places, wave(places), edges)[0]).any()
    drawn, line = effect_line(places, wave(places) + 0.5, edges, wave)
    assert (drawn[0], drawn[-1]) == (0.0, 0.06) and np.max(np.diff(drawn)) < 1e-4
    assert line == pytest.approx(wave(drawn) + 0.5, abs=1e-9)
    drawn, line = effect_line(places, wave(places) + 0.5, edges, None)
    assert np.isfinite(line).all()
    visited = (drawn > 0.0005) & (drawn < 0.019)
    assert line[visited] == pytest.approx(wave(drawn[visited]) + 0.5, abs=0.15)


def test_effects_of_the_position_alone_are_evaluated() -> None:
    cogging, offset = EffectSettings("cogging", (0.8, 0.004, 0.3, 0.1, 0.2)), EffectSettings("offset", (0.5,))
    force = force_over_position([offset, cogging, EffectSettings("spring", (80.0, 0.001))])
    assert force is not None
    places = np.linspace(-0.01, 0.01, 57)
    turns = 2.0 * np.pi * places / 0.004
    ripple = 0.8 * np.sin(turns + 0.3) + 0.1 * np.sin(2.0 * turns + 0.2)
    assert force(places) == pytest.approx(ripple + 80.0 * (places - 0.001))
    assert force_over_position([offset]) is None


def test_stribeck_points_are_means_of_ranges_that_are_narrower_where_it_is_slow() -> None:
    velocity = np.concatenate([np.geomspace(1e-4, 0.1, 400), -np.geomspace(1e-4, 0.1, 400)])
    friction = 4.0 * np.sign(velocity) + 30.0 * velocity
    centre, mean, _deviation = stribeck_points(velocity, friction)
    assert len(centre) == 40 and np.all(np.diff(centre) > 0.0)
    assert mean == pytest.approx(4.0 * np.sign(centre) + 30.0 * centre)


def test_stribeck_points_begin_at_the_slowest_speed_that_slides() -> None:
    """All rows lie between 6 and 50 mm/s: no range is spent below, and the caption says so."""
    velocity = np.concatenate([np.geomspace(6e-3, 0.05, 400), -np.geomspace(8e-3, 0.05, 400)])
    centre, _mean, _deviation = stribeck_points(velocity, np.sign(velocity))
    speeds = centre[centre > 0.0]
    assert len(speeds) == 6 and speeds[0] < 8e-3
    assert np.diff(np.log(speeds)) == pytest.approx(np.log(50.0 / 6.0) / 6, rel=0.1)
    picture = over_velocity("a", "Friction.", velocity, np.sign(velocity), [], Units())
    assert "The plot starts at 6.13 mm/s; slower samples are too close to a reversal." in picture.caption
    shown = re.findall(r">([^<>]+)</text>", picture.svg)
    assert shown[:7] == ["\u221250", "\u221220", "\u221210", "0", "10", "20", "50"]
    wide = np.concatenate([np.geomspace(3e-4, 0.05, 400), -np.geomspace(3e-4, 0.05, 400)])
    shown = re.findall(r">([^<>]+)</text>", over_velocity("a", "b", wide, np.sign(wide), [], Units()).svg)
    assert shown[:5] == ["\u221210", "\u22121", "0", "1", "10"]
    nothing = over_velocity("a", "Friction.", velocity[:3], np.sign(velocity[:3]), [], Units())
    assert "never slides" in nothing.caption and len(stribeck_points(velocity[:3], velocity[:3])[0]) == 0


@pytest.mark.parametrize(
    "slowest, fastest, ticks",
    [
        (3.0, 94.0, [10.0, 50.0]),
        (6.0, 50.0, [10.0, 20.0, 50.0]),
        (1.0, 99.0, [2.0, 10.0, 50.0]),
        (10.0, 100.0, [20.0, 100.0]),
        (0.3, 50.0, [1.0, 10.0]),
        (2.1, 4.9, []),
    ],
)
def test_a_velocity_axis_of_few_decades_has_a_label_near_its_fastest_data(
    slowest: float, fastest: float, ticks: list[float]
) -> None:
    assert speed_ticks(slowest, fastest) == ticks


def test_a_long_plot_keeps_its_peaks_and_holes() -> None:
    time = 1e-4 * np.arange(1_000_000)
    signal = np.sin(time)
    signal[345_678] = 9.0
    signal[765_432] = -9.0
    signal[500_000] = np.nan
    rows = extreme_rows([signal, np.cos(time)], 20_000)
    assert len(rows) <= 26_000 and np.all(np.diff(rows) > 0)
    assert {345_678, 765_432, 500_000} <= set(rows.tolist())
    assert extreme_rows([signal[:100]], 20_000).tolist() == list(range(100))


def test_a_plot_carries_the_numbers_that_it_draws() -> None:
    time = one_after_another([np.array([5.0, 5.1]), np.array([0.0, 0.1, 0.2])])
    values = with_holes([np.array([1.0, 2.0]), np.array([3.0, 4.0, 5.0])])
    assert time == pytest.approx([0.0, 0.1, 0.2, 0.2, 0.3, 0.4, 0.5])
    plot = time_plot("a", "b", time, [Panel("force [N]", [Line("measured", values, "measured")])])
    drawn = plot.draw(20_000)
    packed = drawn.content["panels"][0]["lines"][0]["values"]
    np.testing.assert_array_equal(
        np.frombuffer(base64.b64decode(packed), "<f4"), [1.0, 2.0, np.nan, 3.0, 4.0, 5.0, np.nan]
    )
    assert ">force [N]<" in drawn.still.svg
