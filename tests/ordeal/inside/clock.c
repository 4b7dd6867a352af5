// Loaded into a program (LD_PRELOAD): its clock of the day is ahead by what a file says, in ns.
// Its steady clock goes on. Build: cc -shared -fPIC -o clock.so clock.c
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static volatile int64_t * ahead_ns;

__attribute__((constructor)) static void open_file(void)
{
  const char * path = getenv("ORDEAL_CLOCK");
  int file = path ? open(path, O_RDONLY) : -1;
  if (file < 0) {
    return;
  }
  void * page = mmap(NULL, sizeof(int64_t), PROT_READ, MAP_SHARED, file, 0);
  close(file);
  if (page != MAP_FAILED) {
    ahead_ns = page;
  }
}

int clock_gettime(clockid_t id, struct timespec * now)
{
  int failed = syscall(SYS_clock_gettime, id, now);
  if (!failed && ahead_ns && (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE)) {
    int64_t ns = now->tv_sec * INT64_C(1000000000) + now->tv_nsec + *ahead_ns;
    now->tv_sec = ns / INT64_C(1000000000);
    now->tv_nsec = ns % INT64_C(1000000000);
  }
  return failed;
}

int gettimeofday(struct timeval * restrict now, void * restrict zone)
{
  struct timespec exact;
  (void)zone;
  int failed = clock_gettime(CLOCK_REALTIME, &exact);
  now->tv_sec = exact.tv_sec;
  now->tv_usec = exact.tv_nsec / 1000;
  return failed;
}

time_t time(time_t * where)
{
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (where) {
    *where = now.tv_sec;
  }
  return now.tv_sec;
}
