# Completions of quadrig for fish. The command's own help is read, so that they fit the version that is installed.
function __quadrig_verb
    for word in (commandline -opc)[2..-1]
        if string match -qr '^[a-z]' -- $word
            echo $word
            return
        end
    end
    return 1
end
complete -c quadrig -n 'not __quadrig_verb' -f \
    -a "(quadrig --help 2> /dev/null | sed -n '/^Subcommands:/,/^\$/s/^  \([a-z][a-z]*\) .*/\1/p')"
complete -c quadrig -n 'string match -qr "^-" -- (commandline -ct)' \
    -a "(quadrig (__quadrig_verb) --help 2> /dev/null | sed -n 's/^  \(-.,\)\{0,1\}\(--[a-z][a-z-]*\).*/\2/p')"
