/* Loaded before the C library, it makes syncs of files slow: each takes half a second more, and appends a byte to the file that
 * SLOW_SYNC names. */

#define _GNU_SOURCE
#include <fcntl.h>
#include <stdlib.h>
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
