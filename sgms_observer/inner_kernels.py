"""Compiles inner kernels without separate machine code: LLVM compiles each formula once, inside its caller.

numba compiles every function, and compiles it again as a part of each function that calls it. Only the outermost one is
ever called. Here an inner kernel stays unoptimised LLVM code until its caller is compiled. The results are the same to
the bit, because no floating-point operation may be reordered.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.typed_passes import IRLegalization


class _NoAddresses:
    """Stands for a library's code generator where code without an address would be given its environment."""

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing: the library that contains the code has an environment of its own."""


class _Unoptimised(JITCodeLibrary):  # type: ignore[misc]
    """The code of one function for linking into others; it has no address."""

    codegen = _NoAddresses()

    def _optimize_final_module(self) -> None:
        """Leave it to the caller's library."""

    def _finalize_final_module(self) -> None:
        """Make it linkable, without machine code."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return no address: nobody calls it but code that contains it."""
        self._ensure_finalized()
        return 0


@register_pass(mutates_CFG=False, analysis_only=True)
class _ChooseLibrary(AnalysisPass):  # type: ignore[misc]
    """Has the function lowered into a library without machine code."""

    _name = "sgms_observer_choose_library"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Put the library where the lowering looks for it."""
        state.library = _Unoptimised(state.targetctx.codegen(), state.func_id.func_qualname)
        return False


class _InnerCompiler(Compiler):  # type: ignore[misc]
    """numba's own compiler but for the library."""

    def define_pipelines(self) -> Any:
        """Return numba's pipelines with one pass more."""
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.add_pass_after(_ChooseLibrary, IRLegalization)
            pipeline.finalize()
        return pipelines


def call_inside(compiled: Any, function: Callable[..., Any], **options: Any) -> None:
    """Have kernels that call ``compiled`` contain its code instead of linking to machine code of its own.

    Args:
        compiled: the dispatcher that Python calls.
        function: what it compiles.
        options: of ``numba.njit``, the same as for ``compiled``.
    """
    compile_kernel: Any = numba.njit  # its stubs leave out the options that numba itself passes on
    inner = compile_kernel(
        function, pipeline_class=_InnerCompiler, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
    )
    compiled.get_call_template = inner.get_call_template
    compiled.get_overload = inner.get_overload
