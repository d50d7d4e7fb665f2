/* The BLAS shall start no threads: Rodyn uses one, and OpenBLAS would start one for each core before the program begins, and
 * wait for ever at the end where their memory could not be had (ulimit -v). It counts the processors it may use when it is
 * loaded, so that it is shown one.
 *
 * Functions in .preinit_array run before those of all libraries; constructors of the program after them. The environment
 * (OPENBLAS_NUM_THREADS) will not do: the C library forgets what is set before its own start.
 */
#define _GNU_SOURCE
#include <sched.h>

static cpu_set_t allowed;
static int narrowed;

static void show_one_processor(void)
{
   cpu_set_t one;
   int here = sched_getcpu();

   if (here < 0 || here >= CPU_SETSIZE || sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
   CPU_ZERO(&one);
   CPU_SET(here, &one);
   narrowed = sched_setaffinity(0, sizeof one, &one) == 0;
}

__attribute__((constructor)) static void show_all_processors(void)
{
   if (narrowed) sched_setaffinity(0, sizeof allowed, &allowed);
}

__attribute__((section(".preinit_array"), used)) static void (*before_libraries)(void) = show_one_processor;
