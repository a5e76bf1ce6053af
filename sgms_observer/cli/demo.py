"""``sgms demo``: both nodes as processes on the ROS graph, recorded, compared with the truth, and shown in a report."""

from __future__ import annotations

import argparse
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from sgms_observer.cli.compile import compile_or_warn
from sgms_observer.cli.options import add_output_options, add_overwrite_option, require_ros
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import Outcome

if TYPE_CHECKING:
    from sgms_observer.nodes.conductor import Conductor

HELP = "run a simulated stage and its observer on the ROS graph, without and with compensation, and write a report"

STAGE, OBSERVER, RECORDER = "stage_node", "observer_node", "recorder"
TRUTH = "friction_true"
_RECORDED = (
    "position", "control_effort", "reference", TRUTH,
    "friction_estimate", "friction_std", "friction_compensation", "friction_elements",
    "compensation_horizon", "reference_horizon",
    "friction_parameters", "/diagnostics",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("--out", default="out/demo", metavar="DIR", help="folder of the results (default: out/demo)")
    parser.add_argument(
        "--duration", type=float, default=20.0, metavar="S", help="time on the graph [s], half of it compensated"
    )
    parser.add_argument("--config", metavar="F", help="parameter file of both nodes (default: config/demo.yaml)")
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.bags.bag_folder import REPORT, refuse_bag_folder, refuse_existing_bag
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.settings.load import load_settings
    from sgms_observer.settings.node_parameters import refuse_missing
    from sgms_observer.shipped import shipped_file
    from sgms_observer.whole_file import refuse_existing_files, try_folder

    if not 4.0 <= args.duration <= 3600.0:
        raise ConfigurationError([f"--duration = {args.duration:g} s must be between 4 and 3600; give for instance 20"])
    config = Path(args.config) if args.config else shipped_file("config", "demo.yaml")
    settings = load_settings(config)
    refuse_missing(settings, settings.axes)
    require_ros()
    from sgms_observer.report.demonstration_run import RESULT, present

    out = Path(args.out)
    bag = out / "bag"
    refuse_bag_folder(out)
    refuse_existing_bag(bag, args.overwrite)
    refuse_existing_files([out / REPORT, out / RESULT], args.overwrite)
    try_folder(out)
    shutil.rmtree(bag, ignore_errors=True)
    switched_ns, answered_ns, notes = _play(config, [axis.name for axis in settings.axes], out, bag, args.duration)
    result = present(bag, settings, switched_ns, answered_ns, out)
    for line in [*result.lines, *notes]:
        print(line)
    warn(result.warnings)
    print(f"report: {result.page}")
    print(f"bag:    {bag}")
    return Outcome(result=result.result)


def _play(config: Path, axes: list[str], out: Path, bag: Path, duration: float) -> tuple[int, int, list[str]]:
    """Run the nodes and record them; return when compensation was asked for, when answered [ns], and the notes."""
    from sgms_observer.cli.progress import Progress
    from sgms_observer.nodes.conductor import Conductor, prepare_graph
    from sgms_observer.nodes.pace import AGE_SENTENCE

    compile_or_warn()
    domain = prepare_graph()
    print(f"starting {STAGE}, {OBSERVER} and a recorder on this machine's graph, ROS_DOMAIN_ID {domain}", flush=True)
    with Conductor(out / "log") as conductor:
        file = ["--config", str(config)]
        conductor.start(OBSERVER, "sgms_observer.nodes.observer_node", file)
        conductor.start(STAGE, "sgms_observer.nodes.stage_node", [*file, "--ros-args", "-p", "autostart:=false"])
        conductor.start(RECORDER, "sgms_observer", ["record", "--out", str(bag), *_RECORDED])
        conductor.wait_active(OBSERVER)
        conductor.configure(STAGE)
        listeners = {"position": 2, "control_effort": 2, "reference": 2, TRUTH: 1}
        conductor.wait_subscribers({**listeners, "friction_estimate": 1, "friction_compensation": 2})
        print(f"running for {duration:g} s: the first half without compensation, the second with it", flush=True)
        with Progress("demo", duration) as progress:
            conductor.activate(STAGE)
            _sleep(conductor, duration / 2, progress.show)
            switched_ns = time.time_ns()
            for axis in axes:
                conductor.set_parameter(OBSERVER, f"{axis}.compensation.enabled", True)
            answered_ns = time.time_ns()  # seconds later, where the middleware lost a request
            _sleep(conductor, duration / 2, lambda seconds: progress.show(duration / 2 + seconds))
        conductor.deactivate(STAGE)
        conductor.wait_processed(OBSERVER)  # a busy machine has messages on their way yet
        for name in (RECORDER, OBSERVER, STAGE):
            conductor.stop(name)
        output_lines = conductor.output_of(STAGE).splitlines()
    noted = [AGE_SENTENCE + line.partition(AGE_SENTENCE)[2] for line in output_lines if AGE_SENTENCE in line]
    return switched_ns, answered_ns, [f"                      {line}" for line in noted]


def _sleep(conductor: Conductor, seconds: float, show: Callable[[float], None]) -> None:
    """Wait while every process runs; ``show`` is called with the elapsed time [s]."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        conductor.watch()
        show(seconds - left)
        time.sleep(min(0.2, left))
