#!/usr/bin/env bash
# A planned run on one machine, shard by shard: loop.sh RUN. A worker that crashed is started again: what it was at
# counts, and an episode that crashes two workers becomes a row with outcome `error`.
set -u
run=$1
duet=${DUET:-duet}
threads=${THREADS:-$(nproc)}
while shards=$("$duet" status "$run" --unfinished) && [ -n "$shards" ]; do
  for shard in $shards; do
    "$duet" work "$run" --shard "$shard" -j "$threads"
    code=$?
    # 0 done, 3 done with errors; from 128 on it crashed; 75 and 130 stopped; all else is wrong with the run itself.
    case $code in 0 | 3) ;; *) [ "$code" -ge 132 ] || exit "$code" ;; esac
  done
done
exec "$duet" merge "$run"
