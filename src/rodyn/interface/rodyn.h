/* Rodyn as a shared library: cases and results in memory. docs/python.md has an example.
 *
 * Calls return an exit code of the program: 0 done, 1 the run failed, 2 bad input, 75 stopped; the message is with the case.
 * Texts are UTF-8 and end with a zero. What a call returns a pointer to belongs to the case (until the next call with it) or to the
 * result (until it is freed). Calls must not overlap, not even of different threads with different cases.
 */
#ifndef RODYN_H
#define RODYN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct rodyn_case rodyn_case;
typedef struct rodyn_result rodyn_result;

/* Called about five times a second with the time reached, the end [s], the number of steps; anything but 0 stops the run. */
typedef int (*rodyn_watcher)(double t, double t_end, int64_t n_steps, void *data);

typedef struct {
   const char *name;
   const char *dims;      /* what it runs over, the slowest first: "time rod" */
   const char *units;     /* may be empty */
   const char *long_name;
   int kind;              /* of values: 0 double, 1 int32_t, 2 texts of equal length, filled with blanks, without zeros */
   int text_length;       /* of each text */
   int64_t shape[2];      /* as dims; the second is 1 if there is one dimension only. The last one runs fastest */
   const void *values;
} rodyn_array;

typedef struct {
   const char *name;
   int kind;              /* 0 text, 1 x, 2 and 3 number */
   const char *text;
   double x;
   int64_t number;
} rodyn_attribute;

void rodyn_initialize(void); /* first of all */
const char *rodyn_version(void);

rodyn_case *rodyn_case_new(const char *text, const char *name);                  /* a namelist; name: in messages */
int rodyn_case_set(rodyn_case *, const char *key, const char *values);           /* "chain.hinge_stiffness(0)", "6e3" */
int rodyn_case_check(rodyn_case *);                                              /* all faults at once */
int rodyn_case_run(rodyn_case *, rodyn_watcher, void *data, rodyn_result **);    /* the watcher may be NULL. Refused: no result, NULL */
int rodyn_case_modes(rodyn_case *, int at, rodyn_result **);                     /* at: 0 the start, 1 the equilibrium, 2 the start under loads */
const char *rodyn_case_message(rodyn_case *);                                    /* of the last call; one line for each fault */
const char *rodyn_case_resolved(rodyn_case *);                                   /* every key with the value used; NULL: faults */
void rodyn_case_free(rodyn_case *);

int rodyn_result_arrays(rodyn_result *);
void rodyn_result_array(rodyn_result *, int i, rodyn_array *);                   /* i = 0, 1, ... */
int rodyn_result_attributes(rodyn_result *);
void rodyn_result_attribute(rodyn_result *, int i, rodyn_attribute *);
void rodyn_result_free(rodyn_result *);

#ifdef __cplusplus
}
#endif

#endif
