"""python -m lie_codegen: the command line."""

from lie_codegen.cli.app import main

main()
