"""``sgms paper``: compute the paper's Table II and figures, and the package's best result on the same signals."""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path

from sgms_observer.cli.options import add_output_options, add_overwrite_option
from sgms_observer.outcome import Outcome

HELP = "make the paper's Table II and Figures 2, 3, 5-7 again, and the package's best result on the same signals"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder for report.html, table2, beyond and the figures"
    )
    parser.add_argument("--seeds", type=_count, default=20, metavar="N", help="noise seeds 1..N (default: 20)")
    parser.add_argument(
        "--consistency-seeds", type=_count, default=100, metavar="N", help="noise seeds of the NIS test (default: 100)"
    )
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.bags.bag_folder import refuse_bag_folder
    from sgms_observer.cli.progress import Progress
    from sgms_observer.paper.best_configuration import beyond, beyond_markdown, runs_beyond
    from sgms_observer.paper.figures import (
        estimates_over_time,
        figure_five,
        figure_three,
        figure_two,
        figures_six_and_seven,
    )
    from sgms_observer.paper.report import paper_page
    from sgms_observer.paper.table import runs_of_table, table_markdown, table_two
    from sgms_observer.report.page import write_page
    from sgms_observer.whole_file import refuse_existing_files, try_folder, write_text

    folder = Path(args.out)
    refuse_bag_folder(folder)
    refuse_existing_files([folder / name for name in ("table2.json", "beyond.json", "report.html")], args.overwrite)
    runs = runs_of_table(args.seeds) + runs_beyond(args.seeds, args.consistency_seeds)
    done = itertools.count(1)
    try_folder(folder)
    with Progress("paper", runs) as progress:
        table = table_two(args.seeds, lambda: progress.show(next(done)))
        write_text(json.dumps(table, indent=1), folder / "table2.json")
        write_text(table_markdown(table), folder / "table2.md")
        figures = [*figure_two(), *figure_three(), figure_five(), *figures_six_and_seven()]
        further = beyond(args.seeds, args.consistency_seeds, lambda: progress.show(next(done)))
        write_text(json.dumps(further, indent=1), folder / "beyond.json")
        write_text(beyond_markdown(further), folder / "beyond.md")
        write_page(paper_page(table, further, figures, estimates_over_time()), folder)
    print(table_markdown(table).split("\n## ")[0])
    print(beyond_markdown(further))
    print(f"seeds 1 to {args.seeds}; everything is in {folder}")
    return Outcome(result={"schema": 1, "folder": str(folder), "table2": table, "beyond": further})


def _count(text: str) -> int:
    """Return a number of seeds, or say why it is none."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 2:
        raise argparse.ArgumentTypeError(f"{text} is no number of seeds; give 2 or more")
    return value
