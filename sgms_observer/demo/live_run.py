"""One live run: stage, observer and recorder, with the compensation switched on half way."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from sgms_observer.demo.processes import Program, own_graph
from sgms_observer.errors import SgmsError

TOPICS = (
    "position",
    "control_effort",
    "reference",
    "friction_true",
    "friction_estimate",
    "friction_std",
    "friction_compensation",
    "friction_elements",
    "friction_parameters",
    "/diagnostics",
)
_LOOK_EVERY = 0.2  # s
_SERVICE_PATIENCE = 20.0  # s


def record_live_run(
    config: Path, axis: str, bag: Path, duration: float, show: Callable[[float], None], say: Callable[[str], None]
) -> None:
    """Run both nodes and record them.

    Args:
        config: parameter file of both nodes.
        axis: its axis, whose compensation is switched on after half of the time.
        bag: the new bag.
        duration: time to record [s].
        show: called with the time recorded so far [s].
        say: called with what happens.

    Raises:
        SgmsError: a program did not start or ended by itself.
    """
    folder = bag.parent
    nodes = ["--config", str(config)]
    programs: list[Program] = []
    codes: dict[str, int] = {}
    try:
        say("starting observer_node and stage_node (a first start compiles the kernels: a minute or two)")
        programs.append(Program("observer_node", "sgms_observer.nodes.observer_node", nodes, folder))
        programs.append(Program("stage_node", "sgms_observer.nodes.stage_node", nodes, folder))
        for program in programs:
            program.wait_for("active: axes")
        programs.append(
            Program("recorder", "sgms_observer.cli.main", ["record", *TOPICS, "--out", str(bag)], folder)
        )
        programs[-1].wait_for("recording into")
        say(f"recording {duration:g} s at {bag}; the compensation goes on after {duration / 2:g} s")
        start = time.monotonic()
        is_on = False
        while (elapsed := time.monotonic() - start) < duration:
            if not is_on and elapsed >= duration / 2:
                _enable_compensation(axis)
                is_on = True
            for program in programs:
                program.require_running()
            show(elapsed)
            time.sleep(_LOOK_EVERY)
        show(duration)
    finally:
        for program in reversed(programs):
            codes[program.name] = program.stop()
    for name, code in codes.items():
        if code != 0:
            raise SgmsError(f"{name} ended with exit code {code}; read {folder / (name + '.log')}")


def _enable_compensation(axis: str) -> None:
    """Switch the compensation on as a user would: by its parameter."""
    os.environ.update({key: own_graph()[key] for key in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE")})
    import rclpy
    from rclpy.parameter import Parameter
    from rclpy.parameter_client import AsyncParameterClient

    rclpy.init(args=[], signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    node = rclpy.create_node("sgms_demo")
    try:
        client = AsyncParameterClient(node, "observer_node")
        name = f"{axis}.compensation.enabled"
        if not client.wait_for_services(_SERVICE_PATIENCE):
            raise SgmsError(f"observer_node does not answer; {name} could not be set")
        future = client.set_parameters([Parameter(name, value=True)])
        rclpy.spin_until_future_complete(node, future, timeout_sec=_SERVICE_PATIENCE)
        answer = future.result()
        if answer is None or not answer.results[0].successful:
            reason = answer.results[0].reason if answer else "no answer"
            raise SgmsError(f"observer_node refused {name}: {reason}")
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
