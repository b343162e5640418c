#!/bin/sh
# What the continuous integration of a repository of scenes calls when one of them changes: uploads what is new, builds
# a version, compares it with the champion on the held-out scenes, and fails if it is worse by more than a threshold.
#
# Needs only `diaphane`. Everything comes from the environment and is passed on as arguments, never as shell code:
#
#   DIAPHANE_URL            the server
#   DIAPHANE_KEY            an API key with the scope submit (and publish, if RETRAIN_PROMOTE is true)
#   RETRAIN_NAME            name of the bundle
#   RETRAIN_SCENES          scenes to train on: a file, a pattern or an id on each line
#   RETRAIN_HOLDOUT         scenes to evaluate on and never train on, the same way
#   RETRAIN_MAX_REGRESSION  fraction by which an error may exceed the champion's (0.05)
#   RETRAIN_BASELINE        champion, or none: nothing is compared (champion)
#   RETRAIN_START_FROM      network that the training begins with: champion, scratch, or NAME@ALIAS (champion)
#   RETRAIN_REPLAY          false: do not train again on what that network was trained on (true)
#   RETRAIN_PROMOTE         true: a better version becomes the champion, else it stays a candidate (false)
#   RETRAIN_SUMMARY         file that the Markdown table for the pull request is written to
#   RETRAIN_VIEWS, RETRAIN_LICENCE
#                           as the options of `diaphane retrain`; empty: its defaults
#
# `diaphane retrain` itself reads its options of a build in the same way; its help names the variables.
#
# Arguments of the script are passed on to `diaphane retrain` as well. Exit status: 0 passed, 1 worse or failed, others
# as `diaphane` documents them.

set -eu

die() {
    printf 'retrain: %s\n' "$1" >&2
    exit 2
}

command -v diaphane >/dev/null || die 'diaphane is not installed.'
[ -n "${DIAPHANE_KEY:-}${DIAPHANE_KEY_FILE:-}" ] || die 'set DIAPHANE_KEY, from a secret of the repository.'
[ -n "${RETRAIN_NAME:-}" ] || die 'set RETRAIN_NAME to the name of the bundle.'
[ -n "${RETRAIN_SCENES:-}" ] || die 'set RETRAIN_SCENES to the scenes, one on each line.'
[ -n "${RETRAIN_HOLDOUT:-}" ] || die 'set RETRAIN_HOLDOUT to the scenes to evaluate on, one on each line.'

set -- retrain "$@" --name="$RETRAIN_NAME"

# An empty value is the same as none: that is what an input without a value looks like.
for option in max-regression="${RETRAIN_MAX_REGRESSION:-}" baseline="${RETRAIN_BASELINE:-}" \
    from="${RETRAIN_START_FROM:-}" summary="${RETRAIN_SUMMARY:-}" views="${RETRAIN_VIEWS:-}" \
    licence="${RETRAIN_LICENCE:-}"; do
    [ -z "${option#*=}" ] || set -- "$@" "--$option"
done

case "${RETRAIN_PROMOTE:-false}" in
    true) set -- "$@" --promote ;;
    false) ;;
    *) die "RETRAIN_PROMOTE is '$RETRAIN_PROMOTE': use true or false." ;;
esac

case "${RETRAIN_REPLAY:-true}" in
    true) ;;
    false) set -- "$@" --no-replay ;;
    *) die "RETRAIN_REPLAY is '$RETRAIN_REPLAY': use true or false." ;;
esac

# Prints a file or id on each line. A line that is no file is a pattern: with no field separators, an unquoted line is
# expanded but not split. A pattern that matches nothing stays, and diaphane says that there is no such file.
expand() (
    IFS=
    printf '%s\n' "$1" | while read -r line; do
        if [ -z "$line" ] || [ -e "$line" ]; then
            printf '%s\n' "$line"
            continue
        fi
        for file in $line; do
            printf '%s\n' "$file"
        done
    done
)

while IFS= read -r file; do
    [ -z "$file" ] || set -- "$@" "--holdout=$file"
done <<END
$(expand "$RETRAIN_HOLDOUT")
END

set -- "$@" --
while IFS= read -r file; do
    [ -z "$file" ] || set -- "$@" "$file"
done <<END
$(expand "$RETRAIN_SCENES")
END

exec diaphane "$@"
