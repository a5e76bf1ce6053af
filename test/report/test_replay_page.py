"""``sgms replay`` writes a page: whether the model fits, and what the recording says of its own outputs."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report

from sgms_observer.application.replay import replay_bag
from sgms_observer.bags.source import BagReader
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.observer.samples import Samples
from sgms_observer.report.replayed import AxisView
from sgms_observer.settings.load import load_settings

_CONFIG = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 3.0
      friction: {{coulomb_force: {coulomb}, static_force: {static}}}
      stage: {{encoder: {{noise: 1.0e-9}}, force_noise: 0.01, friction: {{coulomb_force: 4.0, static_force: 4.5}}}}
      filter: {{window: 8.0e-3}}
      estimator: {{kind: ekf}}
      compensation: {{enabled: true}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording, its replay and a replay with a wrong model."""
    made = tmp_path_factory.mktemp("replay_page")
    (made / "right.yaml").write_text(_CONFIG.format(coulomb=4.0, static=4.5))
    (made / "wrong.yaml").write_text(_CONFIG.format(coulomb=9.0, static=9.5))
    assert main(["simulate", "--config", str(made / "right.yaml"), "--out", str(made / "bag"), "--duration", "3"]) == 0
    for name in ("right", "wrong"):
        assert main(_replay(made, "bag", name, name)) == 0
    return made


def _replay(folder: Path, bag: str, config: str, out: str, *more: str) -> list[str]:
    return ["replay", str(folder / bag), "--config", str(folder / f"{config}.yaml"), "--out", str(folder / out), *more]


def test_the_page_reads_well_everywhere(folder: Path, browser: Browser) -> None:
    check_report(browser, folder / "right" / "report.html", 2)


def test_the_page_says_whether_the_model_fits(folder: Path) -> None:
    right, wrong = ((folder / name / "report.html").read_text() for name in ("right", "wrong"))
    assert "The model of x fits the recording" in right and "from the simulated truth" in right
    assert "The model of x does not fit the recording" in wrong and "run sgms diagnose" in wrong


def test_above_nis_2_console_page_and_json_say_that_the_model_does_not_fit(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A Coulomb force that is 5 % wrong gives NIS 3: below the limit of the live node, above the one of a replay."""
    (folder / "near.yaml").write_text(_CONFIG.format(coulomb=4.2, static=4.7))
    assert main(_replay(folder, "bag", "near", "near", "--json")) == 0
    printed = capsys.readouterr()
    nis = json.loads(printed.out)["axes"]["x"]["nis"]
    assert 2.0 < nis < 5.0
    sentence = f"NIS {nis:.4g} is above 2: the model lacks something or a parameter is wrong; run sgms diagnose"
    assert f"Warning: x: {sentence}\n" in printed.err
    page = (folder / "near" / "report.html").read_text()
    assert "The model of x does not fit the recording" in page and sentence in page
    assert main(_replay(folder, "bag", "right", "fitting", "--no-report")) == 0
    assert "NIS" not in capsys.readouterr().err


def test_json_names_the_page_and_a_bag_with_its_page_may_be_overwritten(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(_replay(folder, "bag", "right", "right", "--overwrite", "--json")) == 0
    assert json.loads(capsys.readouterr().out)["report"] == str(folder / "right" / "report.html")
    assert main(_replay(folder, "bag", "right", "plain", "--no-report")) == 0
    assert not (folder / "plain" / "report.html").exists()


def test_recorded_estimates_are_compared_bit_by_bit(folder: Path) -> None:
    """A recording with outputs: the simulated inputs, and the estimates of another replay as if they were live."""
    both = folder / "both"
    for part in ("bag", "right"):
        shutil.copytree(folder / part, both / part)
    (both / "live").mkdir()
    for part in ("bag", "right"):
        for file in (both / part).glob("*.mcap"):
            shutil.copy(file, both / "live" / file.name)
    assert main(_replay(folder, "both/live", "right", "again")) == 0
    assert "The replay reproduces 3000 of 3000 recorded estimates exactly" in (folder / "again/report.html").read_text()
    assert main(_replay(folder, "both/live", "wrong", "other")) == 0
    page = (folder / "other/report.html").read_text()
    assert "of 3000 recorded estimates" in page and "other parameters" in page


def test_what_is_kept_of_a_long_recording_is_bounded_and_has_its_peaks(folder: Path) -> None:
    axis = load_settings(folder / "right.yaml").axes[0]
    count, blocks = 4_000, 200
    view = AxisView(axis, 0, count * blocks)
    for number in range(blocks):
        stamps = (np.arange(count) + number * count) * 1_000_000
        wave = np.sin(1e-9 * stamps)
        position = wave + (0.5 if number == 100 else 0.0) * (np.arange(count) == 77)
        view.add(Samples(stamps, position, wave, wave, wave), _Estimates(stamps, wave))
    rows = view.rows
    assert len(rows) < 100_000 and view.samples == count * blocks
    assert np.nanmax(rows[:, 1] - rows[:, 2]) == pytest.approx(0.5) == view.tracking_peak
    assert len(view.recent(None).time) < 30_000


def test_time_begins_with_the_first_stamp_whenever_its_message_was_received(folder: Path, tmp_path: Path) -> None:
    """The recorder received the first sample 0.4 s after its stamp."""
    bag, config = folder / "bag", str(folder / "right.yaml")
    with BagReader(bag) as reader:
        messages = list(reader.messages())
    with BagWriter(tmp_path / "late", "mcap") as written:
        for topic, stamp_ns, message in messages:
            written.write(topic, "sensor_msgs/msg/JointState", stamp_ns + 400_000_000, message)
    done = replay_bag(
        str(tmp_path / "late"), config, str(tmp_path / "out"), "mcap", {}, lambda _: None, has_report=True
    )
    (view,) = done.views
    time = view.rows[:, 0]
    assert (time[0], time[-1]) == pytest.approx((0.0, 2.999), abs=1e-9)
    assert view.recent(None).time[0] >= 0.0


def test_lines_of_a_replay_break_at_missing_samples(folder: Path) -> None:
    view = AxisView(load_settings(folder / "right.yaml").axes[0], 0, 6_000)
    milliseconds = np.arange(6_000)
    for part in (milliseconds[:1_500], milliseconds[2_500:3_000], milliseconds[4_000:]):
        stamps = part * 1_000_000
        wave = np.sin(1e-9 * stamps)
        view.add(Samples(stamps, wave, wave, wave, wave), _Estimates(stamps, wave))
    rows = view.rows
    assert view.samples == 4_000
    assert rows[np.isnan(rows[:, 1]), 0] == pytest.approx([1.9995, 3.4995])
    assert np.count_nonzero(np.isnan(view.recent(None).position)) >= 2


class _Estimates:
    """What a view reads of estimates."""

    def __init__(self, stamps: np.ndarray, wave: np.ndarray) -> None:
        self.velocity = self.friction = self.friction_std = self.compensation = self.innovation = wave
        self.status = np.zeros(len(stamps), np.uint8)
