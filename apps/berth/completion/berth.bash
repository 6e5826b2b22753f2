# Completion of berth in bash. Made by `berth completion bash`; the program itself says what may follow.

_berth() {
  # Bash splits words at "=" and ":", berth does not: what no blank separates is one word.
  local line=$COMP_LINE words=() word blanks i
  for ((i = 0; i <= COMP_CWORD; ++i)); do
    word=${COMP_WORDS[i]}
    blanks=${line%%[![:blank:]]*}
    line=${line#"$blanks"}
    line=${line#"$word"}
    if [[ $i -eq 0 || -n $blanks ]]; then words+=("$word"); else words[-1]+=$word; fi
  done

  local current=${words[-1]} quote= kept
  # What stands before the part that bash replaces.
  kept=${COMP_WORDS[COMP_CWORD]}
  [[ $kept != [=:] ]] || kept=
  kept=${current%"$kept"}
  [[ $current != [\"\']* ]] || quote=${current:0:1}

  # As the shell would read them, but nothing is carried out.
  for i in "${!words[@]}"; do
    word=${words[i]}
    [[ $word != '~/'* ]] || word=$HOME/${word:2}
    word=${word//[\"\']/}
    words[i]=${word//\\/}
  done
  current=${words[-1]}

  COMPREPLY=()
  local found rest name
  while IFS=$'\t' read -r found rest; do
    case $found in
      :files | :tables | :folders)
        compopt -o filenames 2>/dev/null
        while IFS= read -r name; do
          name=$rest$name
          COMPREPLY+=("${name#"$kept"}")
        done < <(_berth_names "$found" "${current#"$rest"}")
        ;;
      *)
        found=${found#"$kept"}
        [[ -n $quote ]] || printf -v found %q "$found"
        COMPREPLY+=("$found")
        # A value in the same word may follow, a blank does not.
        [[ $found != *= ]] || compopt -o nospace 2>/dev/null
        ;;
    esac
  done < <("${words[0]}" __complete "${words[@]:1}" 2>/dev/null)
}

_berth_names() {
  case $1 in
    :folders) compgen -d -- "$2" ;;
    :files) compgen -f -- "$2" ;;
    :tables)
      compgen -d -- "$2"
      compgen -f -X '!*.toml' -- "$2"
      ;;
  esac
}

complete -F _berth berth
