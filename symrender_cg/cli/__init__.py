"""The command line: one module a command, imported when it is asked for.

    main       argv -> exit code; errors, interrupts and broken pipes end here
    parser     every option with its help; arguments: what a word means; texts: what --help says
    console    tables and numbers as text, plain or by rich
    build, render, explain, check, doctor    run(arguments) -> exit code

Never done here: mathematics, rendering, or an import of sympy on a warm start of build and render.
"""
