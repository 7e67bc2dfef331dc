/* Loaded before the C library, it disturbs a process. Syncs of files are slow: each takes half a second more, and appends a
 * byte to the file that SLOW_SYNC names. The main thread hangs for good at its next wait once the file that HANG names exists. */

#define _GNU_SOURCE
#include <fcntl.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static void delay(void)
{
    const char *path = getenv("SLOW_SYNC");
    int file = path ? open(path, O_WRONLY | O_APPEND) : -1;
    if (file >= 0) {
        struct timespec half = { 0, 500000000 };
        ssize_t written = write(file, ".", 1);
        (void)written;
        close(file);
        nanosleep(&half, NULL);
    }
}

int fdatasync(int file)
{
    delay();
    return (int)syscall(SYS_fdatasync, file);
}

int fsync(int file)
{
    delay();
    return (int)syscall(SYS_fsync, file);
}

int epoll_wait(int poll, struct epoll_event *events, int count, int timeout_ms)
{
    const char *path = getenv("HANG");
    while (path && gettid() == getpid() && access(path, F_OK) == 0)
        pause();
    return (int)syscall(SYS_epoll_pwait, poll, events, count, timeout_ms, NULL, 0);
}
