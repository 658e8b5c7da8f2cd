/* Log the files that a step writes below one prefix.
 *
 * LD_PRELOAD loads this library into every process of a step. FORGE_OBSERVER_LOG names the log,
 * FORGE_OBSERVER_PREFIX the prefix and FORGE_OBSERVER_REAL_PREFIX its path without links. The log starts
 * with two counters, which all processes share:
 *
 *   executed   programs that processes with this library have executed
 *   loaded     programs that have loaded it
 *
 * Where they differ, a program was not observed: a static one, one for another machine, or one that was
 * started without LD_PRELOAD. Records follow, a letter and a word that ends with NUL:
 *
 *   W path   a file or link was written, or renamed to this path, also as a part of a folder
 *   D path   a folder was created, or renamed to this path
 *   U path   a file, link or folder was removed, or renamed to another path
 *   P pid    forge has started a step
 *   L path   this call was refused, since a link of somebody else leads out of the prefix there
 *
 * FORGE_OBSERVER_LINKS names a file with these links, if there are any, each ending with NUL. To write through
 * one would change files that forge neither knows nor can give back, so that the call fails with EACCES.
 *
 * In a merged prefix, the log lies in a folder with copies of what others have there. No step removes or renames
 * these: such a call fails with EACCES as well, so that 'rm -r' of the whole prefix loses nothing.
 *
 * The log is opened for each record, since programs close descriptors that they do not know.
 */
#define _GNU_SOURCE
#include <alloca.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

struct counters {
    uint64_t executed, loaded;
};

static char log_file[PATH_MAX], prefix[PATH_MAX], real_prefix[PATH_MAX];
static char backups[PATH_MAX], moved[PATH_MAX]; /* relative to the prefix, '' if they are elsewhere */
static const char *links, *links_end;
static struct counters *counters;

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

/* Store the absolute path of a name, and return 1 if it is below the prefix. */
static int locate(int folder, const char *path, char *absolute)
{
    char link[40];
    int saved = errno;
    ssize_t size = 0;

    if (!*log_file || !path || strlen(path) >= PATH_MAX)
        return 0;
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
    errno = saved;
    if (size < 0)
        return 0;
    strcpy(absolute + size, path);
    normalize(absolute);
    return is_below(absolute, prefix) || is_below(absolute, real_prefix);
}

static void written(char kind, int folder, const char *path)
{
    char absolute[2 * PATH_MAX + 1];

    if (locate(folder, path, absolute))
        append(kind, absolute);
}

/* An open file may be below the prefix although its path is not: other links lead there. */
static void opened(int folder, const char *path, int descriptor)
{
    char absolute[2 * PATH_MAX + 1], link[40];
    int saved = errno;
    ssize_t size;

    if (!*log_file)
        return;
    if (!locate(folder, path, absolute)) {
        snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
        size = readlink(link, absolute, PATH_MAX);
        absolute[size > 0 ? size : 0] = 0;
        errno = saved;
        if (!is_below(absolute, real_prefix))
            return;
    }
    append('W', absolute);
}

static int refused(int folder, const char *path)
{
    char absolute[2 * PATH_MAX + 1];

    if (!links || !locate(folder, path, absolute))
        return 0;
    for (const char *link = links; link < links_end; link += strlen(link) + 1)
        if (is_below(absolute, link)) {
            append('L', absolute);
            errno = EACCES;
            return 1;
        }
    return 0;
}

/* Tell whether removing or renaming this path would lose the copies; `moved` are files of the package itself. */
static int holds_copies(int folder, const char *path)
{
    char absolute[2 * PATH_MAX + 1];
    const char *place;

    if (!*backups || !locate(folder, path, absolute))
        return 0;
    place = absolute + strlen(is_below(absolute, prefix) ? prefix : real_prefix);
    if (*place && !is_below(backups, place) && (!is_below(place, backups) || is_below(place, moved)))
        return 0;
    errno = EACCES;
    return 1;
}

static int read_variable(const char *name, char *value)
{
    const char *found = getenv(name);

    if (!found || strlen(found) >= PATH_MAX)
        return 0;
    strcpy(value, found);
    return 1;
}

static int exists(int folder, const char *path)
{
    int saved = errno, found = !faccessat(folder, path, F_OK, AT_SYMLINK_NOFOLLOW);

    errno = saved;
    return found;
}

static void read_links(void)
{
    char file[PATH_MAX];
    struct stat status;
    void *content;
    int descriptor;

    if (!read_variable("FORGE_OBSERVER_LINKS", file))
        return;
    descriptor = syscall(SYS_openat, AT_FDCWD, file, O_RDONLY | O_CLOEXEC);
    if (descriptor < 0)
        return;
    if (!fstat(descriptor, &status) && status.st_size > 0) {
        content = mmap(NULL, status.st_size, PROT_READ, MAP_PRIVATE, descriptor, 0);
        if (content != MAP_FAILED) {
            links_end = (const char *)content + status.st_size;
            links = content;
        }
    }
    syscall(SYS_close, descriptor);
}

__attribute__((constructor)) static void start(void)
{
    int saved = errno, descriptor;
    void *page;

    if (!read_variable("FORGE_OBSERVER_PREFIX", prefix) || !read_variable("FORGE_OBSERVER_REAL_PREFIX", real_prefix)
        || !read_variable("FORGE_OBSERVER_LOG", log_file)) {
        *log_file = 0;
        return;
    }
    if (is_below(log_file, prefix)) {
        strcpy(moved, log_file + strlen(prefix));
        strcpy(backups, moved);
        *strrchr(moved, '.') = 0;
        *strrchr(backups, '/') = 0;
    }
    descriptor = syscall(SYS_openat, AT_FDCWD, log_file, O_RDWR | O_CLOEXEC);
    if (descriptor >= 0) {
        page = mmap(NULL, sizeof *counters, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
        syscall(SYS_close, descriptor);
        if (page != MAP_FAILED) {
            counters = page;
            __atomic_add_fetch(&counters->loaded, 1, __ATOMIC_SEQ_CST);
        }
    }
    read_links();
    errno = saved;
}

static void count_executed(int programs)
{
    if (counters)
        __atomic_add_fetch(&counters->executed, (uint64_t)programs, __ATOMIC_SEQ_CST);
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
        if (flags & WRITES && refused(AT_FDCWD, path))                  \
            return -1;                                                  \
        result = NEXT(name)(path, flags, mode);                         \
        if (result >= 0 && flags & WRITES)                              \
            opened(AT_FDCWD, path, result);                             \
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
        if (flags & WRITES && refused(folder, path))                    \
            return -1;                                                  \
        result = NEXT(name)(folder, path, flags, mode);                 \
        if (result >= 0 && flags & WRITES)                              \
            opened(folder, path, result);                                \
        return result;                                                  \
    }

#define CREAT(name)                                                     \
    int name(const char *path, mode_t mode)                             \
    {                                                                   \
        int result = refused(AT_FDCWD, path) ? -1 : NEXT(name)(path, mode); \
        if (result >= 0)                                                \
            opened(AT_FDCWD, path, result);                             \
        return result;                                                  \
    }

#define FOPEN(name)                                                     \
    FILE *name(const char *path, const char *mode)                      \
    {                                                                   \
        int writes = strpbrk(mode, "wa+") && refused(AT_FDCWD, path);    \
        FILE *result = writes ? NULL : NEXT(name)(path, mode);          \
        if (result && strpbrk(mode, "wa+"))                             \
            opened(AT_FDCWD, path, fileno(result));                     \
        return result;                                                  \
    }

#define FREOPEN(name)                                                   \
    FILE *name(const char *path, const char *mode, FILE *stream)        \
    {                                                                   \
        int writes = path && strpbrk(mode, "wa+") && refused(AT_FDCWD, path); \
        FILE *result = writes ? NULL : NEXT(name)(path, mode, stream);  \
        if (result && path && strpbrk(mode, "wa+"))                     \
            opened(AT_FDCWD, path, fileno(result));                     \
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

#define TRUNCATE(name, size_type)                                       \
    int name(const char *path, size_type size)                          \
    {                                                                   \
        int result = refused(AT_FDCWD, path) ? -1 : NEXT(name)(path, size); \
        if (!result)                                                    \
            written('W', AT_FDCWD, path);                               \
        return result;                                                  \
    }

TRUNCATE(truncate, off_t)
#ifdef __GLIBC__
TRUNCATE(truncate64, off64_t)
#endif

/* Names */

static int append_entry(const char *path, const struct stat *status, int kind, struct FTW *place)
{
    (void)status;
    (void)place;
    append(kind == FTW_D || kind == FTW_DNR ? 'D' : 'W', path);
    return 0;
}

/* Log what was renamed, and all that is in it: what others put there later is not the step's. */
static void renamed(int folder, const char *path)
{
    char absolute[2 * PATH_MAX + 1];
    int saved = errno;

    if (locate(folder, path, absolute) && nftw(absolute, append_entry, 16, FTW_PHYS | FTW_MOUNT))
        append('W', absolute);
    errno = saved;
}

int rename(const char *old, const char *path)
{
    int result = holds_copies(AT_FDCWD, old) || refused(AT_FDCWD, old) || refused(AT_FDCWD, path) ? -1 : NEXT(rename)(old, path);
    if (!result) {
        written('U', AT_FDCWD, old);
        renamed(AT_FDCWD, path);
    }
    return result;
}

int renameat(int from, const char *old, int folder, const char *path)
{
    int result = holds_copies(from, old) || refused(from, old) || refused(folder, path) ? -1 : NEXT(renameat)(from, old, folder, path);
    if (!result) {
        written('U', from, old);
        renamed(folder, path);
    }
    return result;
}

#ifdef __GLIBC__
int renameat2(int from, const char *old, int folder, const char *path, unsigned int flags)
{
    int result = holds_copies(from, old) || refused(from, old) || refused(folder, path) ? -1 : NEXT(renameat2)(from, old, folder, path, flags);
    if (!result) {
        written('U', from, old);
        renamed(folder, path);
    }
    return result;
}
#endif

#define REMOVE(name)                                                    \
    int name(const char *path)                                          \
    {                                                                   \
        int keep = exists(AT_FDCWD, path)                               \
            && (holds_copies(AT_FDCWD, path) || refused(AT_FDCWD, path)); \
        int result = keep ? -1 : NEXT(name)(path);                      \
        if (!result)                                                    \
            written('U', AT_FDCWD, path);                               \
        return result;                                                  \
    }

REMOVE(unlink)
REMOVE(rmdir)
REMOVE(remove)

int unlinkat(int folder, const char *path, int flags)
{
    int keep = exists(folder, path) && (holds_copies(folder, path) || refused(folder, path));
    int result = keep ? -1 : NEXT(unlinkat)(folder, path, flags);
    if (!result)
        written('U', folder, path);
    return result;
}

int link(const char *old, const char *path)
{
    int result = refused(AT_FDCWD, path) ? -1 : NEXT(link)(old, path);
    if (!result)
        written('W', AT_FDCWD, path);
    return result;
}

int linkat(int from, const char *old, int folder, const char *path, int flags)
{
    int result = refused(folder, path) ? -1 : NEXT(linkat)(from, old, folder, path, flags);
    if (!result)
        written('W', folder, path);
    return result;
}

int symlink(const char *target, const char *path)
{
    int result = refused(AT_FDCWD, path) ? -1 : NEXT(symlink)(target, path);
    if (!result)
        written('W', AT_FDCWD, path);
    return result;
}

int symlinkat(const char *target, int folder, const char *path)
{
    int result = refused(folder, path) ? -1 : NEXT(symlinkat)(target, folder, path);
    if (!result)
        written('W', folder, path);
    return result;
}

int mkfifo(const char *path, mode_t mode)
{
    int result = refused(AT_FDCWD, path) ? -1 : NEXT(mkfifo)(path, mode);
    if (!result)
        written('W', AT_FDCWD, path);
    return result;
}

int mkdir(const char *path, mode_t mode)
{
    int result = !exists(AT_FDCWD, path) && refused(AT_FDCWD, path) ? -1 : NEXT(mkdir)(path, mode);
    if (!result)
        written('D', AT_FDCWD, path);
    return result;
}

int mkdirat(int folder, const char *path, mode_t mode)
{
    int result = !exists(folder, path) && refused(folder, path) ? -1 : NEXT(mkdirat)(folder, path, mode);
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
    count_executed(1);                                                  \
    result = call;                                                      \
    count_executed(-1);                                                 \
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

/* The C library's execl() does not call the functions above. */
#define EXECUTE_LIST(first, call)                                       \
    va_list arguments;                                                  \
    size_t count = 1;                                                   \
    char **argv;                                                        \
    va_start(arguments, first);                                         \
    while (va_arg(arguments, char *))                                   \
        count++;                                                        \
    va_end(arguments);                                                  \
    argv = alloca((count + 1) * sizeof *argv);                          \
    argv[0] = (char *)first;                                            \
    va_start(arguments, first);                                         \
    for (size_t at = 1; at <= count; at++)                              \
        argv[at] = va_arg(arguments, char *);                           \
    call;                                                               \
    va_end(arguments);                                                  \
    return result

int execl(const char *file, const char *first, ...)
{
    EXECUTE_LIST(first, int result = execv(file, argv));
}

int execlp(const char *file, const char *first, ...)
{
    EXECUTE_LIST(first, int result = execvp(file, argv));
}

int execle(const char *file, const char *first, ...)
{
    EXECUTE_LIST(first, int result = execve(file, argv, va_arg(arguments, char **)));
}

#define SPAWN(name)                                                                       \
    int name(pid_t *process, const char *file, const posix_spawn_file_actions_t *actions, \
             const posix_spawnattr_t *attributes, char *const argv[], char *const envp[]) \
    {                                                                                     \
        int result;                                                                       \
        count_executed(1);                                                                \
        result = NEXT(name)(process, file, actions, attributes, argv, envp);              \
        if (result)                                                                       \
            count_executed(-1);                                                           \
        return result;                                                                    \
    }

SPAWN(posix_spawn)
SPAWN(posix_spawnp)

int system(const char *command)
{
    if (command)
        count_executed(1);
    return NEXT(system)(command);
}

FILE *popen(const char *command, const char *mode)
{
    FILE *result;

    count_executed(1);
    result = NEXT(popen)(command, mode);
    if (!result)
        count_executed(-1);
    return result;
}
