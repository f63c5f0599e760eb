#!/bin/sh
# A document with the base parameters of a Stewart platform: sh stewart_table.sh FILE.tex
# From the root of a clone, with `regen` installed.
set -eu
out="${1:?the name of the .tex file}"
table="$(regen base robots/stewart.yaml --format latex)"
{
    printf '%s\n' '\documentclass{article}' '\usepackage{array,booktabs,xtab}' '\begin{document}'
    printf '%s\n' "$table"
    printf '%s\n' '\end{document}'
} > "$out"
