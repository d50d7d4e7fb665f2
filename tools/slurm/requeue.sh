# shellcheck shell=sh
# For job scripts: run a sweep; when it was stopped by a signal (pre-emption, or 60 s before the time limit), put the job
# back into the queue, where it resumes. Signals that only this shell gets are passed on.
run_or_requeue() {
   "$@" &
   sweep=$!
   trap 'kill -USR1 "$sweep" 2>/dev/null || true' USR1
   trap 'kill -TERM "$sweep" 2>/dev/null || true' TERM
   status=0
   wait "$sweep" || status=$?
   while kill -0 "$sweep" 2>/dev/null; do # a signal ended the wait, not the sweep
      status=0
      wait "$sweep" || status=$?
   done
   if [ "$status" -eq 75 ] && [ -n "${SLURM_JOB_ID:-}" ]; then
      echo "stopped by a signal; job $SLURM_JOB_ID goes back into the queue"
      scontrol requeue "$SLURM_JOB_ID" || true
   fi
   exit "$status"
}
