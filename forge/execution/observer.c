/* Log the files that a step writes below one prefix.
 *
 * LD_PRELOAD loads this library into every process of a step. FORGE_OBSERVER_LOG names the log,
 * FORGE_OBSERVER_PREFIX the prefix. A record is a letter followed by a word, and ends with NUL:
 *
 *   W path   a file or link was written, or renamed to this path; a renamed folder with all that is in it
 *   D path   a folder was created
 *   S pid    a process has loaded this library
 *   E pid    a process is about to execute another program, which has failed if F follows
 *   P pid    a process was started by posix_spawn
 *
 * A process with E or P but without a later S is not observed: a static program, one for another machine,
 * or one that was started without LD_PRELOAD.
 *
 * The log is opened for each record, since programs close descriptors that they do not know.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

static char log_file[PATH_MAX], prefix[PATH_MAX], real_prefix[PATH_MAX];

#define NEXT(name) ((__typeof__(&name))next(#name))

static void *next(const char *name) { return dlsym(RTLD_NEXT, name); }

static void append(char kind, const char *word)
{
    char record[PATH_MAX + 2];
    size_t size = strlen(word);
    int saved = errno, descriptor;

    if (!*log_file || size >= PATH_MAX)
        return;
    record[0] = kind;
    memcpy(record + 1, word, size + 1);
    descriptor = syscall(SYS_openat, AT_FDCWD, log_file, O_WRONLY | O_APPEND | O_CLOEXEC);
    if (descriptor >= 0) {
        if (syscall(SYS_write, descriptor, record, size + 2) < 0)
            errno = saved;
        syscall(SYS_close, descriptor);
    }
    errno = saved;
}

static void append_process(char kind, long process)
{
    char word[24];

    snprintf(word, sizeof word, "%ld", process);
    append(kind, word);
}

/* Remove "//", "/." and "/.." as text. */
static void normalize(char *path)
{
    char *to = path, *from = path;

    while (*from) {
        size_t size;
        while (*from == '/')
            from++;
        size = strcspn(from, "/");
        if (size == 2 && from[0] == '.' && from[1] == '.') {
            while (to > path && *--to != '/')
                ;
        } else if (size && !(size == 1 && from[0] == '.')) {
            *to++ = '/';
            memmove(to, from, size);
            to += size;
        }
        from += size;
    }
    *to = 0;
}

static int is_below(const char *path, const char *folder)
{
    size_t size = strlen(folder);

    return size && !strncmp(path, folder, size) && (!path[size] || path[size] == '/');
}

static void written(char kind, int folder, const char *path)
{
    char absolute[2 * PATH_MAX + 1], link[40];
    int saved = errno;
    ssize_t size = 0;

    if (!*log_file || !path || strlen(path) >= PATH_MAX)
        return;
    if (*path != '/') {
        if (folder == AT_FDCWD)
            size = syscall(SYS_getcwd, absolute, PATH_MAX) > 0 ? (ssize_t)strlen(absolute) : -1;
        else {
            snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
            size = readlink(link, absolute, PATH_MAX);
        }
        if (size > 0)
            absolute[size++] = '/';
    }
    if (size >= 0) {
        strcpy(absolute + size, path);
        normalize(absolute);
        if (is_below(absolute, prefix) || is_below(absolute, real_prefix))
            append(kind, absolute);
    }
    errno = saved;
}

__attribute__((constructor)) static void start(void)
{
    const char *log = getenv("FORGE_OBSERVER_LOG"), *folder = getenv("FORGE_OBSERVER_PREFIX");
    int saved = errno;

    if (!log || !folder || strlen(log) >= PATH_MAX || strlen(folder) >= PATH_MAX)
        return;
    strcpy(prefix, folder);
    if (!realpath(folder, real_prefix))
        *real_prefix = 0;
    strcpy(log_file, log);
    append_process('S', syscall(SYS_getpid));
    errno = saved;
}

/* Opening */

#define WRITES (O_WRONLY | O_RDWR | O_CREAT | O_TRUNC)

static mode_t mode_of(int flags, va_list arguments)
{
    return flags & O_CREAT || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(arguments, mode_t) : 0;
}

#define OPEN(name)                                                      \
    int name(const char *path, int flags, ...)                          \
    {                                                                   \
        va_list arguments;                                              \
        mode_t mode;                                                    \
        int result;                                                     \
        va_start(arguments, flags);                                     \
        mode = mode_of(flags, arguments);                               \
        va_end(arguments);                                              \
        result = NEXT(name)(path, flags, mode);                         \
        if (result >= 0 && flags & WRITES)                              \
            written('W', AT_FDCWD, path);                               \
        return result;                                                  \
    }

#define OPENAT(name)                                                    \
    int name(int folder, const char *path, int flags, ...)              \
    {                                                                   \
        va_list arguments;                                              \
        mode_t mode;                                                    \
        int result;                                                     \
        va_start(arguments, flags);                                     \
        mode = mode_of(flags, arguments);                               \
        va_end(arguments);                                              \
        result = NEXT(name)(folder, path, flags, mode);                 \
        if (result >= 0 && flags & WRITES)                              \
            written('W', folder, path);                                 \
        return result;                                                  \
    }

#define CREAT(name)                                                     \
    int name(const char *path, mode_t mode)                             \
    {                                                                   \
        int result = NEXT(name)(path, mode);                            \
        if (result >= 0)                                                \
            written('W', AT_FDCWD, path);                               \
        return result;                                                  \
    }

#define FOPEN(name)                                                     \
    FILE *name(const char *path, const char *mode)                      \
    {                                                                   \
        FILE *result = NEXT(name)(path, mode);                          \
        if (result && strpbrk(mode, "wa+"))                             \
            written('W', AT_FDCWD, path);                               \
        return result;                                                  \
    }

#define FREOPEN(name)                                                   \
    FILE *name(const char *path, const char *mode, FILE *stream)        \
    {                                                                   \
        FILE *result = NEXT(name)(path, mode, stream);                  \
        if (result && path && strpbrk(mode, "wa+"))                     \
            written('W', AT_FDCWD, path);                               \
        return result;                                                  \
    }

OPEN(open)
OPENAT(openat)
CREAT(creat)
FOPEN(fopen)
FREOPEN(freopen)
#ifdef __GLIBC__
OPEN(open64)
OPENAT(openat64)
CREAT(creat64)
FOPEN(fopen64)
FREOPEN(freopen64)

/* What _FORTIFY_SOURCE makes of calls without a mode. */
int __open_2(const char *path, int flags) { return open(path, flags); }
int __open64_2(const char *path, int flags) { return open64(path, flags); }
int __openat_2(int folder, const char *path, int flags) { return openat(folder, path, flags); }
int __openat64_2(int folder, const char *path, int flags) { return openat64(folder, path, flags); }
#endif

/* Names */

int rename(const char *old, const char *path)
{
    int result = NEXT(rename)(old, path);
    if (!result)
        written('W', AT_FDCWD, path);
    return result;
}

int renameat(int from, const char *old, int folder, const char *path)
{
    int result = NEXT(renameat)(from, old, folder, path);
    if (!result)
        written('W', folder, path);
    return result;
}

#ifdef __GLIBC__
int renameat2(int from, const char *old, int folder, const char *path, unsigned int flags)
{
    int result = NEXT(renameat2)(from, old, folder, path, flags);
    if (!result)
        written('W', folder, path);
    return result;
}
#endif

int link(const char *old, const char *path)
{
    int result = NEXT(link)(old, path);
    if (!result)
        written('W', AT_FDCWD, path);
    return result;
}

int linkat(int from, const char *old, int folder, const char *path, int flags)
{
    int result = NEXT(linkat)(from, old, folder, path, flags);
    if (!result)
        written('W', folder, path);
    return result;
}

int symlink(const char *target, const char *path)
{
    int result = NEXT(symlink)(target, path);
    if (!result)
        written('W', AT_FDCWD, path);
    return result;
}

int symlinkat(const char *target, int folder, const char *path)
{
    int result = NEXT(symlinkat)(target, folder, path);
    if (!result)
        written('W', folder, path);
    return result;
}

int mkfifo(const char *path, mode_t mode)
{
    int result = NEXT(mkfifo)(path, mode);
    if (!result)
        written('W', AT_FDCWD, path);
    return result;
}

int mkdir(const char *path, mode_t mode)
{
    int result = NEXT(mkdir)(path, mode);
    if (!result)
        written('D', AT_FDCWD, path);
    return result;
}

int mkdirat(int folder, const char *path, mode_t mode)
{
    int result = NEXT(mkdirat)(folder, path, mode);
    if (!result)
        written('D', folder, path);
    return result;
}

#define TEMPORARY(call, name)                                           \
    int result = call;                                                  \
    if (result >= 0)                                                    \
        written('W', AT_FDCWD, name);                                   \
    return result

int mkstemp(char *name) { TEMPORARY(NEXT(mkstemp)(name), name); }
int mkostemp(char *name, int flags) { TEMPORARY(NEXT(mkostemp)(name, flags), name); }
int mkstemps(char *name, int length) { TEMPORARY(NEXT(mkstemps)(name, length), name); }
#ifdef __GLIBC__
int mkstemp64(char *name) { TEMPORARY(NEXT(mkstemp64)(name), name); }
int mkostemp64(char *name, int flags) { TEMPORARY(NEXT(mkostemp64)(name, flags), name); }
#endif

char *mkdtemp(char *name)
{
    char *result = NEXT(mkdtemp)(name);
    if (result)
        written('D', AT_FDCWD, name);
    return result;
}

/* Programs */

#define EXECUTE(call)                                                   \
    int result;                                                         \
    append_process('E', syscall(SYS_getpid));                           \
    result = call;                                                      \
    append_process('F', syscall(SYS_getpid));                           \
    return result

int execve(const char *file, char *const argv[], char *const envp[])
{
    EXECUTE(NEXT(execve)(file, argv, envp));
}

int execv(const char *file, char *const argv[]) { EXECUTE(NEXT(execv)(file, argv)); }
int execvp(const char *file, char *const argv[]) { EXECUTE(NEXT(execvp)(file, argv)); }
int fexecve(int file, char *const argv[], char *const envp[])
{
    EXECUTE(NEXT(fexecve)(file, argv, envp));
}
#ifdef __GLIBC__
int execvpe(const char *file, char *const argv[], char *const envp[])
{
    EXECUTE(NEXT(execvpe)(file, argv, envp));
}
#endif

#define SPAWN(name)                                                                             \
    int name(pid_t *process, const char *file, const posix_spawn_file_actions_t *actions,       \
             const posix_spawnattr_t *attributes, char *const argv[], char *const envp[])       \
    {                                                                                           \
        pid_t own = 0;                                                                          \
        int result = NEXT(name)(process ? process : &own, file, actions, attributes, argv, envp); \
        if (!result)                                                                            \
            append_process('P', process ? *process : own);                                      \
        return result;                                                                          \
    }

SPAWN(posix_spawn)
SPAWN(posix_spawnp)
