#!/bin/sh
# A wrapper of rustc that has the lines of the libraries, of the command and of what tests them
# counted: generic functions are compiled where they are used.
rustc="$1"
shift
case " $* " in
*" --crate-name regen_codegen "* | *" --crate-name regen_runtime "* | *" --crate-name regen "* | *" --test "*)
    exec "$rustc" "$@" -C instrument-coverage
    ;;
*) exec "$rustc" "$@" ;;
esac
