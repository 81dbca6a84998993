#!/usr/bin/env bash
# What deploy/completion.bash offers: completion_test.sh SOURCE_DIR BUILD_DIR
set -euo pipefail
source "$1/deploy/completion.bash"
bin=$2/bin

# offers "WORDS AS TYPED" WORD...: the last of the words is completed, and each WORD is among what is offered.
# refuses "WORDS AS TYPED" WORD...: no WORD is.
complete_line() {
  read -r -a COMP_WORDS <<<"$1"
  case $1 in *' ') COMP_WORDS+=("") ;; esac
  COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
  COMPREPLY=()
  _cairn "$bin/${COMP_WORDS[0]}" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
}
offers() {
  complete_line "$1"
  local line=$1 word
  shift
  for word in "$@"; do
    case " ${COMPREPLY[*]} " in *" $word "*) ;; *) echo "'$line' does not offer $word, but: ${COMPREPLY[*]}"; exit 1 ;; esac
  done
}
refuses() {
  complete_line "$1"
  local line=$1 word
  shift
  for word in "$@"; do
    case " ${COMPREPLY[*]} " in *" $word "*) echo "'$line' offers $word"; exit 1 ;; esac
  done
}

offers 'cairn ' replay record map site check-log status sim ping
# Words of the text around the commands.
refuses 'cairn ' cairn stream --help 0
refuses 'cairn robot ' cairn estimator
refuses 'cairn pose ' robot cairn
offers 'cairn ma' map
refuses 'cairn ma' replay
offers 'cairn map ' draw export
refuses 'cairn map ' replay
offers 'cairn map draw --' --site --output --domain
offers 'cairn --domain 7 map ex' export
offers 'cairn map draw -' -o --help
offers 'cairnd --' --config --print-config --set
offers 'cairn-offline --' --trajectory --smooth
offers 'cairn-calibrate ' laser motion
offers 'cairn-web --' --port --token
offers 'cairn sim --laser-model ' thesis lms200 tim561
# Nothing of its own: bash goes on with the names of files.
complete_line 'cairn replay robot1'
[ "${#COMPREPLY[@]}" -eq 0 ] || { echo "a file's name is not left to bash: ${COMPREPLY[*]}"; exit 1; }
echo "completion works for five programs"
