# Completion in bash for all programs of Cairn: commands, options and named values, as the program's own --help prints
# them, so a new option needs no change here. For `cairn`, names of robots and sites and numbers of jobs come from the
# running server, if it answers within a second. Everything else is completed as a file name.

# What a page of help lists: its commands, under one or several headings; its options; the values that an option may have.
_cairn_commands() { awk '/^[^ ]/ { inside = /:$/ && !/^(Options|Positionals):/ } inside && /^  [a-z]/ { print $1 }' <<<"$1"; }
_cairn_options() { grep -oE '^ +(-[A-Za-z],)?--[a-z][a-z0-9-]*' <<<"$1" | grep -oE -- '-.*' | tr ',' '\n'; }
_cairn_values() { grep -E -- "^ +(-[A-Za-z],)?$2[ =:,]|^ +$2," <<<"$1" | grep -oE '\{[^}]*\}' | head -n 1 | tr -d '{}' | tr ',' '\n'; }

# What can stand at the cursor as a page of help says: `robot`, `site` or `id` (of a job), or nothing. PAGE PREVIOUS
_cairn_kind() {
  case $2 in
    -*) grep -oE -- "^ +$2 (TEXT|ROBOT|SITE)( |\$)" <<<"$1" | grep -oE -- '--(robot|site)' | head -n 1 | tr -d - ;;
    *) awk '/^[^ ]/ { inside = /^Positionals:/ } inside && /^  (robot|site|id) / { print $1; exit }' <<<"$1" ;;
  esac
}

# Names of a kind in the running server, which the words typed so far may name: PROGRAM KIND WORDS
_cairn_names() {
  local question field=$2 typed=${*:3} where=()
  case $2 in
    robot) question=(status) ;;
    site) question=(map info) ;;
    id) question=(job list) ;;
    *) return 0 ;;
  esac
  # bash makes words of `=` and `:`.
  typed=${typed// = /=}
  typed=${typed// : /:}
  read -r -a where < <(grep -oE -- '--(domain|set)[ =][^ ]+' <<<"$typed" | tr '\n' ' ')
  "$1" "${where[@]}" --timeout 1 --json "${question[@]}" 2>/dev/null |
    grep -oE "\"$field\":(\"[^\"]+\"|[0-9]+)" | sed 's/^[^:]*://; s/"//g'
}

_cairn() {
  local program=$1 current=$2 previous=$3
  local general help typed word
  general=$("$program" --help 2>/dev/null) || return 0
  help=$general
  local commands=()
  for typed in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    for word in $(_cairn_commands "$help"); do
      [ "$typed" = "$word" ] || continue
      commands+=("$typed")
      help=$("$program" "${commands[@]}" --help 2>/dev/null) || return 0
      break
    done
  done
  local found
  case $current in
    -*) found=$(_cairn_options "$help"; _cairn_options "$general") ;;
    *)
      found=$(_cairn_commands "$help")
      case $previous in -*) found=$(_cairn_values "$help"$'\n'"$general" "$previous") ;; esac
      if [ -z "$found" ] && [ "${program##*/}" = cairn ]; then
        found=$(_cairn_names "$program" "$(_cairn_kind "$help" "$previous")" "${COMP_WORDS[@]:0:COMP_CWORD}" || true)
      fi
      ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$(sort -u <<<"$found")" -- "$current")
}
complete -o default -F _cairn cairn cairnd cairn-offline cairn-calibrate cairn-web
