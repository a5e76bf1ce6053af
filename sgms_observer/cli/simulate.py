"""``sgms simulate``: the simulated stage without a ROS graph, into a bag."""

from __future__ import annotations

import argparse
import math
import time

from sgms_observer.cli.options import add_output_options, add_overwrite_option, add_storage_option
from sgms_observer.outcome import Outcome

HELP = "run the simulated stage of a parameter file, faster than real time, into a bag"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("--config", required=True, metavar="F", help="parameter file (YAML): the axes and their stage")
    parser.add_argument("--out", required=True, metavar="BAG", help="folder of the new bag")
    parser.add_argument(
        "--duration", type=_seconds, default=10.0, metavar="S", help="time to simulate [s] (default: 10)"
    )
    parser.add_argument(
        "--seed", type=_seed, metavar="N", help="seed of every random number, instead of each axis's stage.seed"
    )
    parser.add_argument(
        "--observe",
        action="store_true",
        help="run the observer in the loop as well: its compensation moves the stage, its topics go into the bag",
    )
    add_storage_option(parser)
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.application.simulate import Simulation, simulate
    from sgms_observer.bags.bag_folder import refuse_existing_bag
    from sgms_observer.cli.progress import Progress
    from sgms_observer.settings.load import load_settings
    from sgms_observer.settings.node_parameters import refuse_missing

    refuse_existing_bag(args.out, args.overwrite)
    settings = load_settings(args.config)
    refuse_missing(settings, settings.axes)
    simulation = Simulation(settings, args.duration, args.seed, args.observe)
    names, seeds = ", ".join(simulation.seeds), ", ".join(f"{name}: {seed}" for name, seed in simulation.seeds.items())
    print(f"simulating {simulation.count} samples of {names}, {simulation.duration:g} s; seeds {seeds}")
    start = time.perf_counter()
    with Progress("simulate", simulation.count) as progress:
        done = simulate(simulation, args.out, args.storage, args.overwrite, progress.show)
    seconds = time.perf_counter() - start
    for line in done.errors:
        print(line)
    speed = simulation.duration / seconds
    print(f"{args.out}: {done.messages} messages in {seconds:.1f} s, {speed:.1f} times real time")
    return Outcome(result=done.as_json(simulation, args.out))


def _seconds(text: str) -> float:
    """Return a duration, or say why it is none."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text} is no duration; give seconds above 0")
    return value


def _seed(text: str) -> int:
    """Return a seed, or say why it is none."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is no seed; give a whole number from 0 on")
    return value
