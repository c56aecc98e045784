"""Emit: from a `KernelProgram` to C99 text, through sympy.codegen.ast, a printer and the templates."""
