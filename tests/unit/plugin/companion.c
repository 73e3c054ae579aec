/* SPDX-License-Identifier: Apache-2.0 */
/* A library with a thread that nobody joins, as Embree's scheduler has: unmapping its code would crash the process. */
#include <pthread.h>
#include <unistd.h>

void heddle_test_start_thread(void);

static void* run(void* unused) {
  for (;;) usleep(1000);
  return unused;
}

void heddle_test_start_thread(void) {
  static int is_started;
  pthread_t thread;
  if (is_started++ == 0 && pthread_create(&thread, 0, run, 0) == 0) pthread_detach(thread);
}
