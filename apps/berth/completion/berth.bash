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

  local current=${words[-1]} quote="" kept
  # What stands before the part that bash replaces.
  kept=${COMP_WORDS[COMP_CWORD]}
  [[ $kept != [=:] ]] || kept=
  kept=${current%"$kept"}
  [[ $current != [\"\']* ]] || quote=${current:0:1}

  # As the shell would read them, but nothing is carried out.
  for i in "${!words[@]}"; do
    word=${words[i]}
    # shellcheck disable=SC2088
    [[ $word != "~/"* ]] || word=$HOME/${word:2}
    word=${word//[\"\']/}
    words[i]=${word//\\/}
  done
  current=${words[-1]}

  COMPREPLY=()
  local found rest name files=""
  while IFS=$'\t' read -r found rest; do
    case $found in
      :files | :tables | :folders)
        files=yes
        while IFS= read -r name; do
          name=$rest$name
          COMPREPLY+=("${name#"$kept"}")
        done < <(_berth_names "$found" "${current#"$rest"}")
        ;;
      *) COMPREPLY+=("${found#"$kept"}") ;;
    esac
  done < <("${words[0]}" __complete "${words[@]:1}" 2>/dev/null)

  # Bash itself quotes names of files, and the others with them.
  if [[ -n $files ]]; then
    compopt -o filenames 2>/dev/null
  elif [[ -z $quote ]]; then
    for i in "${!COMPREPLY[@]}"; do printf -v "COMPREPLY[i]" %q "${COMPREPLY[i]}"; done
  fi
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
