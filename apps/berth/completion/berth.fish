# Completion of berth in fish. Made by `berth completion fish`; the program itself says what may follow.

function __berth_complete
    set -l words (commandline -opc)
    set -l current (commandline -ct | string unescape)
    test -n "$current"; or set current ""
    set -l program $words[1]
    set -e words[1]
    for line in ($program __complete $words "$current" 2>/dev/null)
        set -l parts (string split -m 1 \t -- $line)
        switch $parts[1]
            case :files :folders :tables
                set -l begun (string sub -s (math 1 + (string length -- "$parts[2]")) -- "$current")
                for name in (__berth_names $parts[1] "$begun")
                    echo "$parts[2]$name"
                end
            case '*'
                echo $line
        end
    end
end

# Names of files that begin so.
function __berth_names -a which begun
    switch $which
        case :files
            __fish_complete_path "$begun" | string split -f 1 \t
        case :folders
            __fish_complete_directories "$begun" "" | string split -f 1 \t
        case :tables
            __fish_complete_path "$begun" | string split -f 1 \t | string match -r '.*(?:/|\.toml)$'
    end
end

complete -c berth -f -a '(__berth_complete)'
