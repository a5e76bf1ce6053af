"""``sgms init``: a first parameter file, from a template or from a bag."""

from __future__ import annotations

import argparse

from sgms_observer.cli.options import add_bag_options, add_output_options, add_overwrite_option, topics_from
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import Outcome

HELP = "write a commented parameter file: a template, or with the rates, resolution, rough mass and friction of a bag"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("bag", nargs="?", metavar="BAG", help="recording to take values from (default: none)")
    parser.add_argument("--out", required=True, metavar="YAML", help="parameter file to write")
    parser.add_argument(
        "--joint-type",
        choices=("prismatic", "revolute"),
        default="prismatic",
        help="whether the axes slide (m, N, kg) or turn (rad, N m, kg m^2; with gravity) (default: prismatic)",
    )
    parser.add_argument(
        "--position-scale",
        type=float,
        default=1.0,
        metavar="K",
        help="factor from the bag's positions to m or rad (default: 1)",
    )
    parser.add_argument(
        "--effort-scale",
        type=float,
        default=1.0,
        metavar="K",
        help="factor from the bag's efforts to N or N m (default: 1)",
    )
    add_bag_options(parser, "all joints of the bag, or x")
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.application.init import InitOptions, init
    from sgms_observer.settings.units import Units

    options = InitOptions(args.joint_type, args.position_scale, args.effort_scale, args.overwrite)
    done = init(args.bag, args.out, args.axis, topics_from(args.topic), options)
    units = Units(args.joint_type)
    for draft in done.drafts:
        effects = f", {', '.join(draft.effects)}" if draft.effects else ""
        print(
            f"{draft.name}: mass {draft.mass:.4g} {units.mass}, Coulomb friction {draft.coulomb:.4g}"
            f" {units.effort}, viscous"
            f" {draft.viscous:.4g} {units.damping}{effects}"
        )
    warn(done.warnings)
    print(f"wrote {args.out}")
    return Outcome(result=done.as_json())
