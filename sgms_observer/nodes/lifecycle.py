"""Base of both nodes: a lifecycle that activates itself, checked parameters, and work only while active."""

from __future__ import annotations

import gc
import os
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from sgms_observer import jit
from sgms_observer.application.kernels import Compilation, missing_parts
from sgms_observer.bags.rows import warm_up_encoding
from sgms_observer.errors import SgmsError
from sgms_observer.interrupts import is_told
from sgms_observer.nodes.parameters import NodeParameters
from sgms_observer.outcome import LONG_WORK, SHOW_TRACEBACK
from sgms_observer.settings.axis import Settings
from sgms_observer.settings.node_parameters import NodeArguments

ChangesState = Callable[[ChangeState.Request, ChangeState.Response], ChangeState.Response]
_PROGRESS_PERIOD = 10.0  # s
_WATCH = 0.1  # s


class ManagedNode(LifecycleNode):
    """A lifecycle node with the package's settings; subclasses define the work of each state.

    Args:
        name: name of the node.
        executor: the executor that will spin it.
        given: the settings and parameters that it starts with.

    Attributes:
        parts: kernels that the node uses, names of ``application.kernels``.
        has_stage: whether the node uses the parameters below ``stage``.
        settings: the checked settings, which follow the parameters.
        fault: error that ended the node's work; None after a signal or a shutdown.
    """

    parts: tuple[str, ...] = ()
    has_stage = False

    def __init__(self, name: str, executor: Executor, given: NodeArguments) -> None:
        values = given.parameters or {}
        super().__init__(name, parameter_overrides=[Parameter(key, value=value) for key, value in values.items()])
        self.own_executor = executor
        self.steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.parameters = NodeParameters(self, given.settings, self.has_stage)
        self.settings: Settings = given.settings
        self.is_configured = False
        self.is_active = False
        self.fault: Exception | None = None
        self._failure: Exception | None = None
        self._compilation: Compilation | None = None
        self._progress_due = 0.0
        for service in self.services:
            if service.srv_type is ChangeState:
                service.callback = self._refusing(service.callback)
        self.add_on_set_parameters_callback(self._judge_parameters)
        self.add_post_set_parameters_callback(self._take_parameters)

    def prepare(self) -> bool:
        """Compile missing kernels in other processes, while this one answers services; return whether all are compiled.

        Call it repeatedly. A process that compiles by itself answers no service until it has finished.
        """
        if self._compilation is None:
            missing = missing_parts(self.parts) if jit.can_keep() else ()
            self._compilation = Compilation(missing)
            self._progress_due = time.monotonic()
            if missing:
                self.get_logger().info(
                    "compiling the numerical kernels, once after an installation; 'sgms compile' does it ahead"
                )
        is_over = self._compilation.poll()
        left = self._compilation.seconds_left
        if not is_over and left is not None and time.monotonic() >= self._progress_due:
            self._progress_due = time.monotonic() + _PROGRESS_PERIOD
            self.get_logger().info(
                f"compiling the numerical kernels: {100.0 * self._compilation.share:.0f} %, about {left:.0f} s left"
            )
        return is_over

    def start_by_itself(self) -> None:
        """Configure and activate, unless ``autostart`` is false.

        Raises:
            SgmsError: the node cannot be configured or activated.
        """
        if not self.settings.autostart:
            self.get_logger().info("autostart is false: waiting for a lifecycle manager to configure and activate")
            return
        for transition in (self.trigger_configure, self.trigger_activate):
            if transition() is not TransitionCallbackReturn.SUCCESS:
                raise self._failure or SgmsError("the node could not be activated; see its log")

    def guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """Return a callback that never raises into the executor, which a task's exception would crash.

        An error stops the node's work and ends the process with one sentence. An error during a shutdown of ROS is
        ignored.

        Args:
            callback: any callback without a result.
        """

        def call(*arguments: Any) -> None:
            try:
                if self.fault is None:
                    callback(*arguments)
            except Exception as error:
                if not self.context.ok():
                    return
                if os.environ.get(SHOW_TRACEBACK):
                    traceback.print_exc()
                self.fault = error

        return call

    def warm_up(self) -> None:
        """Run the kernels once; called while configuring, after a note that it may take long."""

    def _warm_up_all(self) -> None:
        warm_up_encoding()
        self.warm_up()

    def set_up(self) -> None:
        """Make publishers and subscriptions for ``self.settings``."""

    def begin(self) -> None:
        """Start to work."""

    def end(self) -> None:
        """Stop to work; publishers are still there."""

    def tear_down(self) -> None:
        """Undo ``set_up``."""

    def on_tuned(self) -> None:
        """Apply ``self.settings`` after a change of settings that may change while the node runs."""

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Configure the node.

        Args:
            state: the one before.
        """
        try:
            self._wait_for_kernels()
            self._apart(self._warm_up_all)
            self.set_up()
        except Exception as error:
            if is_told() or not self.context.ok():
                return TransitionCallbackReturn.FAILURE
            self._failure = error
            for sentence in str(error).splitlines():
                self.get_logger().error(sentence)
            return TransitionCallbackReturn.FAILURE
        self.is_configured = True
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Activate the node.

        Args:
            state: the one before.
        """
        gc.collect()
        gc.freeze()  # the garbage collector skips the objects of the start: on a large heap they take it 0.1 s
        self.begin()
        self.is_active = True
        self.get_logger().info(f"active: axes {', '.join(axis.name for axis in self.settings.axes)}")
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop to work.

        Args:
            state: the one before.
        """
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything.

        Args:
            state: the one before.
        """
        self._forget()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and forget everything.

        Args:
            state: the one before.
        """
        self._stop()
        self._forget()
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        """End the node, its work first."""
        if self._compilation is not None:
            self._compilation.stop()
        fault, self.fault = self.fault, None
        self.guarded(self._stop)()
        self.fault = fault or self.fault
        super().destroy_node()
        # rclpy does not release it. It holds the node's participant, whose threads would run into the end of Python.
        self._state_machine.destroy_when_not_in_use()

    def _refusing(self, change: ChangesState) -> ChangesState:
        """Return the service of transitions that refuses an invalid transition.

        The service of rclpy raises an error into the executor, so that one wrong request ends the node.
        """

        def refuse_or_change(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
            try:
                return change(request, response)
            except RuntimeError as error:
                self.get_logger().warning(f"the requested transition is not allowed in the present state: {error}")
                response.success = False
                return response

        return refuse_or_change

    def _wait_for_kernels(self) -> None:
        """Wait for the kernels if they are not compiled yet; warn where numba or a writable cache is missing."""
        while not self.prepare() and self.context.ok() and not is_told():
            time.sleep(_WATCH)
        if not jit.HAS_NUMBA:
            self.get_logger().warning(
                "numba is not installed: every computation takes about a hundred times longer; install numba"
            )
        elif missing_parts(self.parts):
            self.get_logger().warning(
                "the numerical kernels cannot be cached and are compiled in this process: no service is answered"
                f" for about a minute at every start; make {jit.cache_folder()} writable or set XDG_CACHE_HOME"
            )

    def _apart(self, work: Callable[[], None]) -> None:
        """Do long work in a thread, so that a signal ends the process at once and not after the compilation."""
        errors: list[BaseException] = []

        def run() -> None:
            try:
                work()
            except BaseException as error:
                errors.append(error)

        thread = threading.Thread(target=run, name=LONG_WORK, daemon=True)
        thread.start()
        while thread.is_alive() and self.context.ok() and not is_told():
            thread.join(0.1)
        if errors:
            raise errors[0]
        if thread.is_alive():
            raise SgmsError("the node received a stop signal during its start")

    def _stop(self) -> None:
        if self.is_active:
            self.is_active = False
            self.end()

    def _forget(self) -> None:
        if self.is_configured:
            self.is_configured = False
            self.tear_down()

    def _judge_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        return self.parameters.check_change(parameters, self.is_configured)

    def _take_parameters(self, parameters: Sequence[Parameter]) -> None:
        if any(parameter.name in self.parameters.names for parameter in parameters):
            self.settings = self.parameters.settings
            if self.is_configured:
                self.on_tuned()
