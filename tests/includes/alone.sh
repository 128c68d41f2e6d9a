#!/usr/bin/env bash
# usage: alone.sh SOURCE WORK EIGEN_INCLUDE COMPILER...
# Compiles every header and .ipp alone, without a warning. The library's own names have to come from its own includes;
# what stands in the standard library and in Eigen is compiled once before all, as a precompiled header.
set -euo pipefail
source=$1 work=$2 eigen=$3
shift 3
rm -rf "$work"
mkdir -p "$work"
flags=(-std=c++20 -DQUADRIG_COMPILED "-I$source/include" -isystem "$eigen" -Wall -Wextra -Wconversion -Wshadow -Wpedantic -Werror)
grep -rhoE '^#include <(Eigen/[A-Za-z]+|[a-z_0-9]+)>' "$source/include/quadrig" --include='*.hpp' --include='*.ipp' |
  sort -u > "$work/outside.hpp"
"$@" "${flags[@]}" -x c++-header "$work/outside.hpp" -o "$work/outside.hpp.gch"
cd "$source/include"
# What wraps a library is checked where that library is.
find quadrig -name '*.hpp' -o -name '*.ipp' | sort | while read -r header; do
  case $header in
    *solver/cholmod.hpp) "$@" "${flags[@]}" -fsyntax-only -x c++ -include cholmod.h /dev/null 2> /dev/null || continue ;;
    *solver/petsc.hpp) continue ;;
  esac
  echo "$header"
done > "$work/headers"
[[ -s $work/headers ]]
status=0
export work
compile() {
  local header=$1
  shift
  printf '#include "%s"\n' "$header" > "$work/${header//\//_}.cpp"
  "$@" -include "$work/outside.hpp" -fsyntax-only "$work/${header//\//_}.cpp" || { echo "$header does not compile alone"; return 1; }
}
export -f compile
xargs -P "$(nproc)" -I HEADER bash -c 'compile "$@"' compile HEADER "$@" "${flags[@]}" < "$work/headers" || status=1
echo "$(wc -l < "$work/headers") headers"
exit $status
