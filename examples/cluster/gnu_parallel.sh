#!/usr/bin/env bash
# A planned run by GNU parallel: gnu_parallel.sh RUN [OPTION OF PARALLEL...]. On this machine with as many workers as it
# has cores; on others that see the same folder with `--sshlogin n1,n2`. A worker that fails is tried four times.
set -eu
run=$(realpath "$1")
shift
duet=${DUET:-duet}
"$duet" status "$run" --unfinished |
  parallel --quote --jobs "${JOBS:-100%}" --retries 4 "$@" "$duet" work "$run" --shard {} --quiet
exec "$duet" merge "$run"
