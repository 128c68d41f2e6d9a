# Completions of quadrig for bash. The command's own help is read, so that they fit the version that is installed.
_quadrig() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} verb= word help values
  COMPREPLY=()
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    [[ $word == [a-z]* ]] && { verb=$word; break; }
  done
  if [[ -z $verb && $current != -* ]]; then
    values=$("${COMP_WORDS[0]}" --help 2> /dev/null | sed -n '/^Subcommands:/,/^$/s/^  \([a-z][a-z]*\) .*/\1/p')
    mapfile -t COMPREPLY < <(compgen -W "$values" -- "$current")
    return
  fi
  help=$("${COMP_WORDS[0]}" ${verb:+"$verb"} --help 2> /dev/null)
  if [[ $previous == --* ]]; then
    # An option whose help lists its values: --weld never|seams|all.
    values=$(sed -n "s/^  \(-.,\)\{0,1\}$previous \([a-z]*|[a-z|]*\).*/\2/p" <<< "$help" | head -n 1 | tr '|' ' ')
    if [[ -n $values ]]; then
      mapfile -t COMPREPLY < <(compgen -W "$values" -- "$current")
      return
    fi
  fi
  if [[ $current == -* ]]; then
    values=$(sed -n 's/^  \(-.,\)\{0,1\}\(--[a-z][a-z-]*\).*/\2/p' <<< "$help")
    mapfile -t COMPREPLY < <(compgen -W "$values" -- "$current")
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
  fi
}
complete -o filenames -F _quadrig quadrig
