#compdef quadrig
# Completions of quadrig for zsh. The command's own help is read, so that they fit the version that is installed.
_quadrig() {
  local verb= word help
  local -a found
  for word in ${words[2,CURRENT-1]}; do
    [[ $word == [a-z]* ]] && { verb=$word; break; }
  done
  if [[ -z $verb && ${words[CURRENT]} != -* ]]; then
    found=(${(f)"$(${words[1]} --help 2> /dev/null | sed -n '/^Subcommands:/,/^$/s/^  \([a-z][a-z]*\) .*/\1/p')"})
    compadd -a found
    return
  fi
  help=$(${words[1]} $verb --help 2> /dev/null)
  if [[ ${words[CURRENT-1]} == --* ]]; then
    found=(${(s:|:)"$(print -r -- $help | sed -n "s/^  \(-.,\)\{0,1\}${words[CURRENT-1]} \([a-z]*|[a-z|]*\).*/\2/p" | head -n 1)"})
    (($#found)) && { compadd -a found; return; }
  fi
  if [[ ${words[CURRENT]} == -* ]]; then
    found=(${(f)"$(print -r -- $help | sed -n 's/^  \(-.,\)\{0,1\}\(--[a-z][a-z-]*\).*/\2/p')"})
    compadd -a found
  else
    _files
  fi
}
_quadrig "$@"
