/* Log how the processes of a step access the file system.
 *
 * LD_PRELOAD loads this library into every process of a step. FORGE_OBSERVER_LOG names a log that all of
 * them map into memory: a record is written without a system call, and none is lost if a process is killed.
 * The log is a header and chunks, each of one process, which hold records until a size of 0 or the chunk's end.
 * Space is allocated before it is used, so that a full disk kills no process.
 * Records follow, a letter and a word that ends with NUL:
 *
 *   P path   this process has loaded the library, as it began to run this program
 *   O pid    the parent of this process, after P or as a copy of its parent
 *   C words  the command that a shell or Python runs
 *   X path   this process is about to execute a program
 *   F path   ... and could not
 *   S pid    this process has started a program in another process
 *   R path   a file was opened for reading
 *   Y path   a shared library was loaded
 *   T path   a file or folder was found, but not opened
 *   L path   the names in a folder were read
 *   N path   nothing was found; `path` ends with the first name that is missing
 *   W path   a file or link was written, or renamed to this path, also as a part of a folder
 *   D path   a folder was created, or renamed to this path
 *   U path   a file, link or folder was removed, or renamed to another path
 *   V name   an environment variable was requested
 *   J word   the digest and the path of the ledger of this program's own files, see observed.py
 *   K what   a device was opened, or a socket or shared memory through which others may answer
 *   n path   a call failed or created a file, and nothing was there; t path: something was there
 *   l path   the same as L where Python looks for modules or distributions
 *   I paths  the folders in which Python looks for modules from now on, each in a line
 *   M name   Python looks for a module
 *   B what   something that cannot be observed
 *   E path   this call was refused, since an unowned link leads out of the prefix there
 *
 * Paths are absolute; ".." is kept, since the folder before it may be a link. A process logs each record once,
 * as far as a small table remembers.
 *
 * No step removes or renames the folder of the log, which contains copies of other packages' files in a merged prefix:
 * such a call fails with EACCES, so that 'rm -r' of the whole prefix loses nothing.
 *
 * FORGE_OBSERVER_LINKS names a file with unowned links below the prefix, each ending with NUL. Writing through
 * one would change files that forge neither tracks nor can restore, so that the call fails with EACCES.
 *
 * With FORGE_COLOURS, compilers colour their messages as on a terminal, and ninja passes that on: no command and no
 * variable changes, so that nothing is built again for it.
 *
 * With FORGE_OBSERVER_STAGE, that file has spellings of the prefix instead, and each path below it means the same
 * path in the stage: the step neither finds nor changes the last build, but knows no other path than the prefix.
 * Accesses that cannot be redirected to the stage are logged as B. If several packages share the prefix, an empty
 * word follows, and the paths of this package alone, sorted, relative to the prefix: all other paths refer to the
 * prefix, until they exist in the stage. Changing files of others is refused.
 */
#define _GNU_SOURCE
#include <alloca.h>
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#ifdef __GLIBC__
#include <fts.h>
#endif
#include <ftw.h>
#include <glob.h>
#include <limits.h>
#include <link.h>
#include <mntent.h>
#include <mqueue.h>
#include <netdb.h>
#include <pthread.h>
#include <semaphore.h>
#include <spawn.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/vfs.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/types.h>
#include <sys/un.h>
#include <sys/xattr.h>
#include <unistd.h>
#include <utime.h>
#include <wordexp.h>

#define EXPORT __attribute__((visibility("default")))
/* The next definition of a function, which this library hides. */
#define NEXT(name)                                                              \
    (__extension__({                                                            \
        static __typeof__(&name) found_##name;                                  \
        if (!found_##name)                                                      \
            found_##name = (__typeof__(&name))dlsym(RTLD_NEXT, #name);          \
        found_##name;                                                           \
    }))
/* The C library's function, which this library hides. */
static __typeof__(&syscall) kernel(void)
{
    static __typeof__(&syscall) found;

    if (!found)
        found = (__typeof__(&syscall))dlsym(RTLD_NEXT, "syscall");
    return found;
}

#define LOG "FORGE_OBSERVER_LOG="
#define LINKS "FORGE_OBSERVER_LINKS="
#define STAGE "FORGE_OBSERVER_STAGE="
#define COLOURS "FORGE_COLOURS="
#define PRELOAD "LD_PRELOAD="

extern char **environ;

#define HEADER 4096

#define ALLOCATED_AT_ONCE (1 << 20)

struct header {
    uint64_t end;       /* of the last chunk */
    uint64_t records;   /* started so far */
    uint64_t lost;      /* nonzero after a process ran out of space */
    uint64_t allocated; /* disk space is allocated up to here */
};

struct chunk {
    uint32_t size, pid;
};

struct record {
    uint32_t size, order;
    char kind, path[];
};

static char log_variable[sizeof LOG + PATH_MAX], links_variable[sizeof LINKS + PATH_MAX], stage_variable[sizeof STAGE + PATH_MAX];
static char library[PATH_MAX];
static char backups[2 * PATH_MAX], moved[PATH_MAX]; /* the folder of the log, with and without links; a name below */
static char *map;
static size_t map_size;
static const char *links, *links_end, *stage, *own, *own_end; /* the last two if the prefix is shared */

static struct {
    uint64_t at, end;
    size_t size;
    uint32_t pid;
    char busy;
} chunk;

/* Allocate disk space up to an offset; return 0 if there is none. */
static int allocate(struct header *header, uint64_t end)
{
    uint64_t allocated = __atomic_load_n(&header->allocated, __ATOMIC_ACQUIRE);
    int descriptor, done;

    if (end <= allocated)
        return 1;
    end = (end + ALLOCATED_AT_ONCE) / ALLOCATED_AT_ONCE * ALLOCATED_AT_ONCE;
    descriptor = kernel()(SYS_openat, AT_FDCWD, log_variable + strlen(LOG), O_WRONLY | O_CLOEXEC);
    done = descriptor >= 0 && !kernel()(SYS_fallocate, descriptor, 0, allocated, end - allocated);
    if (descriptor >= 0)
        kernel()(SYS_close, descriptor);
    while (done && allocated < end)
        if (__atomic_compare_exchange_n(&header->allocated, &allocated, end, 0, __ATOMIC_RELEASE, __ATOMIC_ACQUIRE))
            break;
    return done;
}

/* Return the offset of space at the end of the log, 0 if there is none. */
static uint64_t extend(size_t size)
{
    struct header *header = (struct header *)map;
    uint64_t at = __atomic_fetch_add(&header->end, size, __ATOMIC_RELAXED);

    if (at + size + ALLOCATED_AT_ONCE <= map_size && allocate(header, at + size))
        return at;
    __atomic_store_n(&header->lost, 1, __ATOMIC_RELAXED);
    return 0;
}

/* Return space for a record: in this process's chunk, or in a separate one if another thread or a signal's
 * handler is in this function. */
static char *reserve(size_t size, uint32_t pid)
{
    int alone = !__atomic_test_and_set(&chunk.busy, __ATOMIC_ACQUIRE);
    uint64_t at;

    if (alone && chunk.pid == pid && chunk.at + size <= chunk.end) {
        at = chunk.at;
        chunk.at += size;
    } else {
        size_t more = sizeof(struct chunk) + size, length;
        if (alone && chunk.pid == pid && chunk.size < 16 * HEADER)
            chunk.size *= 4;
        else if (alone && chunk.pid != pid)
            chunk.size = HEADER;
        length = alone && more <= chunk.size ? chunk.size : (more + HEADER - 1) / HEADER * HEADER;
        at = extend(length);
        if (at) {
            struct chunk *head = (struct chunk *)(map + at);
            head->pid = pid;
            head->size = (uint32_t)length;
            if (alone) {
                chunk.pid = pid;
                chunk.end = at + length;
                chunk.at = at + more;
            }
            at += sizeof *head;
        }
    }
    if (alone)
        __atomic_clear(&chunk.busy, __ATOMIC_RELEASE);
    return at ? map + at : NULL;
}

static pid_t own_process, announced_copy;

static void note_child_of(long process);

static void say(char kind, const char *word, size_t length)
{
    size_t size = (sizeof(struct record) + length + 1 + 3) & ~(size_t)3;
    struct record *record;
    pid_t process;
    int saved = errno;

    if (!map)
        return;
    process = kernel()(SYS_getpid);
    if (own_process && process != own_process && process != announced_copy) {
        /* After vfork() or clone(), perhaps in the parent's memory. */
        announced_copy = process;
        note_child_of(kernel()(SYS_getppid));
    }
    record = (struct record *)reserve(size, (uint32_t)process);
    if (record) {
        record->order = (uint32_t)__atomic_fetch_add(&((struct header *)map)->records, 1, __ATOMIC_RELAXED);
        record->kind = kind;
        memcpy(record->path, word, length);
        record->path[length] = 0;
        __atomic_store_n(&record->size, (uint32_t)size, __ATOMIC_RELEASE);
    }
    errno = saved;
}

/* The records that this process has logged: a table without locks, in which a newer entry replaces an older one. */

#define ENTRIES (1 << 14)
static uint64_t entries[ENTRIES];

static uint64_t hash(char kind, const char *word, size_t length)
{
    uint64_t value = 14695981039346656037ULL ^ (unsigned char)kind;

    for (size_t at = 0; at < length; at++)
        value = (value ^ (unsigned char)word[at]) * 1099511628211ULL;
    value ^= value >> 32;
    return value | 1;
}

static int remember_value(uint64_t value)
{
    uint64_t *entry = &entries[(value >> 1) % ENTRIES];

    if (__atomic_load_n(entry, __ATOMIC_RELAXED) == value)
        return 0;
    __atomic_store_n(entry, value, __ATOMIC_RELAXED);
    return 1;
}

static int remember(char kind, const char *word, size_t length)
{
    return remember_value(hash(kind, word, length));
}

static void forget(char kind, const char *word, size_t length)
{
    uint64_t value = hash(kind, word, length), *entry = &entries[(value >> 1) % ENTRIES];

    if (__atomic_load_n(entry, __ATOMIC_RELAXED) == value)
        __atomic_store_n(entry, 0, __ATOMIC_RELAXED);
}

/* Virtual files about processes and devices are not inputs, but those about the processor are. */
static int is_kernels(const char *path)
{
    return (!strncmp(path, "/proc/", 6) && strcmp(path, "/proc/cpuinfo")) || !strncmp(path, "/sys/", 5);
}

/* Return whether a path below /dev is an input, like a file in /dev/shm; targets of links to open files were logged
 * when they were opened. */
static int is_no_device(const char *path)
{
    char link[40], place[PATH_MAX] = "";
    struct stat status;
    int descriptor;

    if (!NEXT(fstatat)(AT_FDCWD, path, &status, 0) && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode))
        return 0;
    descriptor = kernel()(SYS_openat, AT_FDCWD, path, O_PATH | O_NOFOLLOW | O_CLOEXEC);
    if (descriptor < 0)
        return 1;
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    kernel()(SYS_readlinkat, AT_FDCWD, link, place, sizeof place - 1);
    if (!is_kernels(place)) {
        memset(place, 0, sizeof place);
        kernel()(SYS_readlinkat, descriptor, "", place, sizeof place - 1);
    }
    kernel()(SYS_close, descriptor);
    return !is_kernels(place);
}

static void note(char kind, const char *word)
{
    size_t length = strlen(word);

    if (map && remember(kind, word, length) && (strncmp(word, "/dev/", 5) || is_no_device(word)))
        say(kind, word, length);
}

static int is_below(const char *path, const char *folder)
{
    size_t size = strlen(folder);

    return size && !strncmp(path, folder, size) && (!path[size] || path[size] == '/');
}

static const char *staged(int folder, const char *path, char *place);

/* Name a path of the stage as one of the prefix; return its length, 0 if it does not fit. */
static size_t unstage(char *path, size_t size)
{
    size_t length = strlen(path), from, to;

    if (!stage || !is_below(path, stage))
        return length;
    from = strlen(stage), to = strlen(links);
    if (length - from + to >= size)
        return 0;
    memmove(path + to, path + from, length - from + 1);
    memcpy(path, links, to);
    return length - from + to;
}

/* Store the absolute path of a name; return its length, 0 if it has none. */
static size_t locate(int folder, const char *path, char *absolute)
{
    char *to = absolute;
    const char *from = path;
    ssize_t size = 0;

    if (!path || !*path)
        return 0;
    if (*path != '/') {
        if (folder == AT_FDCWD)
            size = kernel()(SYS_getcwd, absolute, PATH_MAX) > 0 ? (ssize_t)strlen(absolute) : errno == ERANGE ? PATH_MAX : -1;
        else {
            char link[40];
            snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
            size = kernel()(SYS_readlinkat, AT_FDCWD, link, absolute, PATH_MAX - 1);
        }
        if (size <= 0 || (size < PATH_MAX && *absolute != '/'))
            return 0;
        to += size == 1 ? 0 : size;
    }
    if (size + strlen(path) + 2 > PATH_MAX) {
        if (size)
            note('B', "a long path");
        return 0;
    }
    while (*from) {
        size_t length;
        while (*from == '/')
            from++;
        length = strcspn(from, "/");
        if (length && !(length == 1 && *from == '.')) {
            *to++ = '/';
            memcpy(to, from, length);
            to += length;
        }
        from += length;
    }
    if (to == absolute)
        *to++ = '/';
    *to = 0;
    return unstage(absolute, PATH_MAX);
}

/* Return the first "/.." of a path. */
static char *climb(char *path)
{
    while ((path = strstr(path, "/..")) && path[3] && path[3] != '/')
        path++;
    return path;
}

/* Resolve the ".." of an absolute path; return 0 if a folder before one is missing. */
static int resolve_parents(char *absolute)
{
    char place[PATH_MAX], link[40], rest[PATH_MAX], *up;

    while ((up = climb(absolute))) {
        int descriptor;
        ssize_t size;
        strcpy(rest, up + 3);
        *up = 0;
        descriptor = kernel()(SYS_openat, AT_FDCWD, *absolute ? staged(AT_FDCWD, absolute, place) : "/", O_PATH | O_CLOEXEC);
        if (descriptor < 0)
            return 0;
        snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
        size = kernel()(SYS_readlinkat, AT_FDCWD, link, place, sizeof place - 1);
        kernel()(SYS_close, descriptor);
        if (size <= 0)
            return 0;
        place[size] = 0;
        if (!unstage(place, sizeof place))
            return 0;
        *strrchr(place, '/') = 0;
        if (strlen(place) + strlen(rest) + 2 > PATH_MAX)
            return 0;
        snprintf(absolute, PATH_MAX, "%s%s", place, *place || *rest ? rest : "/");
    }
    return 1;
}

static int is_own(const char *path)
{
    for (const char *low = own, *high = own_end, *each; low < high;) {
        int order;
        for (each = low + (high - low) / 2; each > low && each[-1];)
            each--;
        order = strcmp(path, each);
        if (!order)
            return 1;
        if (order < 0)
            high = each;
        else
            low = each + strlen(each) + 1;
    }
    return 0;
}

/* Return whether others have an entry at a path in a shared prefix; `rest` is its part below the prefix. */
static int is_of_others(const char *absolute, const char *rest, struct stat *status)
{
    return own && (!*rest || !is_own(rest + 1)) && !NEXT(fstatat)(AT_FDCWD, absolute, status, AT_SYMLINK_NOFOLLOW);
}

/* Create the folder of a path in the stage, as far as it exists in the shared prefix. */
static void make_parents(char *place)
{
    char absolute[PATH_MAX];
    struct stat status;

    for (char *at = place + strlen(stage); at; at = strchr(at + 1, '/')) {
        char rest = *at;
        *at = 0;
        snprintf(absolute, sizeof absolute, "%s%s", links, place + strlen(stage));
        if (!is_of_others(absolute, place + strlen(stage), &status) || !S_ISDIR(status.st_mode))
            at = NULL;
        else if (!kernel()(SYS_mkdirat, AT_FDCWD, place, 0700))
            kernel()(SYS_fchmodat, AT_FDCWD, place, status.st_mode & 07777);
        if (!at) {
            place[strlen(place)] = rest;
            return;
        }
        *at = rest;
        if (!rest)
            return;
    }
}

enum { LOOKS, CREATES, ALTERS };

/* Return the path to use: one in `place` if the path is below the prefix of a stage, else the path itself. */
static const char *lead(int folder, const char *path, char *place, int purpose)
{
    char absolute[PATH_MAX];
    struct stat status;
    const char *result = path;
    int saved = errno;

    if (stage && locate(folder, path, absolute)) {
        int climbs = climb(absolute) != NULL;
        if (!climbs || resolve_parents(absolute)) {
            size_t size = strlen(path);
            const char *end = path[size - 1] == '/' || (size > 1 && !strcmp(path + size - 2, "/.")) ? "/" : "";
            for (const char *prefix = links; prefix < links_end; prefix += strlen(prefix) + 1)
                if (is_below(absolute, prefix) && strlen(stage) + strlen(absolute) + 2 < PATH_MAX + strlen(prefix)) {
                    const char *rest = absolute + strlen(prefix);
                    int is_others;
                    if (own && (is_below(absolute, backups) || is_below(absolute, backups + PATH_MAX)))
                        break;
                    snprintf(place, PATH_MAX, "%s%s", stage, rest);
                    is_others = (!own || !*rest || NEXT(fstatat)(AT_FDCWD, place, &status, AT_SYMLINK_NOFOLLOW))
                        && is_of_others(absolute, rest, &status);
                    if (is_others && !(purpose == ALTERS && S_ISDIR(status.st_mode) && *rest))
                        strcpy(place, absolute);
                    else if (own && purpose != LOOKS) {
                        make_parents(place);
                        if (is_others && !kernel()(SYS_mkdirat, AT_FDCWD, place, 0700))
                            kernel()(SYS_fchmodat, AT_FDCWD, place, status.st_mode & 07777);
                    }
                    if (strlen(place) + 2 < PATH_MAX)
                        strcat(place, end);
                    errno = saved;
                    return place;
                }
            if (climbs && *path != '/') /* perhaps out of the stage */
                result = strcpy(place, absolute);
        }
    }
    errno = saved;
    return result;
}

static const char *staged(int folder, const char *path, char *place)
{
    return lead(folder, path, place, LOOKS);
}

#define IN_STAGE(folder, purpose)                                               \
    char place[PATH_MAX];                                                       \
    const char *given = path;                                                   \
    path = lead(folder, path, place, purpose)

/* Log that a step has used files of the last build. */
static void note_last_build(const char *path)
{
    for (const char *prefix = links; stage && prefix < links_end; prefix += strlen(prefix) + 1)
        if (is_below(path, prefix) && !is_below(path, stage) && (!own || is_own(path + strlen(prefix) + 1)))
            note('B', "what is installed");
}

static void found(char kind, int folder, const char *path)
{
    char absolute[PATH_MAX];
    int saved = errno;

    if (map && locate(folder, path, absolute) && !is_kernels(absolute) && strcmp(absolute, log_variable + strlen(LOG)))
        note(kind, absolute);
    errno = saved;
}

static void changed(char kind, int folder, const char *path)
{
    char absolute[PATH_MAX];
    size_t length;
    int saved = errno;

    if (map && (length = locate(folder, path, absolute)) && !is_kernels(absolute)) {
        /* A file that is written, removed and read again is a new one each time. */
        forget(kind == 'U' ? 'W' : 'U', absolute, length);
        forget('R', absolute, length);
        note(kind, absolute);
    }
    errno = saved;
}

static int is_there(const char *path)
{
    char place[PATH_MAX];

    return kernel()(SYS_faccessat, AT_FDCWD, staged(AT_FDCWD, path, place), F_OK) == 0;
}

static int is_entry(int folder, const char *path)
{
    int saved = errno;
    char place[PATH_MAX];
    struct stat status;
    int result = !NEXT(fstatat)(folder, staged(folder, path, place), &status, AT_SYMLINK_NOFOLLOW);

    errno = saved;
    return result;
}

/* Log whether the path of a failed call exists, which matters to tests only. */
static void attempted(int folder, const char *path)
{
    char absolute[PATH_MAX];
    int saved = errno;

    if (map && locate(folder, path, absolute) && !is_kernels(absolute))
        note(is_entry(AT_FDCWD, absolute) ? 't' : 'n', absolute);
    errno = saved;
}

/* Log the first missing name of a path: while it is missing, the following ones cannot appear. */
static void missing(int folder, const char *path)
{
    char absolute[PATH_MAX];
    size_t length;
    int saved = errno;

    if (map && saved == EACCES)
        found('T', folder, path); /* its mode forbids it */
    if (!map)
        return;
    if (saved != ENOENT && (saved != ENOTDIR || is_entry(folder, path))) {
        attempted(folder, path);
        return;
    }
    length = locate(folder, path, absolute);
    if (length && !is_kernels(absolute)) {
        for (;;) {
            size_t parent = length;
            char slash;
            if (!remember('N', absolute, length))
                break;
            while (parent > 1 && absolute[parent - 1] != '/')
                parent--;
            parent -= parent > 1;
            slash = absolute[parent];
            absolute[parent] = 0;
            if (parent == 1 || !remember('f', absolute, parent) || is_there(absolute)) {
                absolute[parent] = slash;
                say('N', absolute, length);
                break;
            }
            forget('f', absolute, parent);
            length = parent;
        }
    }
    errno = saved;
}

static int is_guarded(int folder, const char *path, char *absolute)
{
    if (links && !stage && locate(folder, path, absolute))
        for (const char *link = links; link < links_end; link += strlen(link) + 1)
            if (is_below(absolute, link))
                return 1;
    return 0;
}

/* Return 1 with EACCES if entries of others in a shared prefix would be changed while a stage exists. */
static int belongs_to_others(int folder, const char *path, int with_folders)
{
    char absolute[PATH_MAX], place[PATH_MAX];
    struct stat status;

    if (!own || !locate(folder, path, absolute) || is_below(absolute, backups) || is_below(absolute, backups + PATH_MAX))
        return 0;
    for (const char *prefix = links; prefix < links_end; prefix += strlen(prefix) + 1)
        if (is_below(absolute, prefix) && !is_below(staged(AT_FDCWD, absolute, place), stage)
            && is_of_others(absolute, absolute + strlen(prefix), &status) && (with_folders || !S_ISDIR(status.st_mode))) {
            note('B', "files of others");
            errno = EACCES;
            return 1;
        }
    return 0;
}

/* Return 1 with EACCES if an unowned link leads out of the prefix here. */
static int refused(int folder, const char *path)
{
    char absolute[PATH_MAX];
    int saved = errno;

    if (is_guarded(folder, path, absolute)) {
        note('E', absolute);
        errno = EACCES;
        return 1;
    }
    if (belongs_to_others(folder, path, 0))
        return 1;
    errno = saved;
    return 0;
}

/* Return 1 with EACCES if removing or renaming this path would lose the folder of the log with its copies of
 * other packages' files in a merged prefix; `moved` are files of the package itself. */
static int holds_copies(int folder, const char *path)
{
    char absolute[PATH_MAX];
    int saved = errno;

    if (belongs_to_others(folder, path, 1))
        return 1;
    if (*backups && locate(folder, path, absolute))
        for (int at = 0; at < 2; at++) {
            size_t length = strlen(backups + at * PATH_MAX);
            const char *spelled = backups + at * PATH_MAX;
            int is_own = !strncmp(absolute, spelled, length) && is_below(absolute + length, moved);
            if (is_below(spelled, absolute) || (is_below(absolute, spelled) && !is_own)) {
                errno = EACCES;
                return 1;
            }
        }
    errno = saved;
    return 0;
}

/* Start */

static ElfW(Dyn) *entry_of(struct link_map *object, int tag)
{
    ElfW(Dyn) *each = object->l_ld;

    while (each && each->d_tag != DT_NULL && each->d_tag != tag)
        each++;
    return each && each->d_tag == tag ? each : NULL;
}

/* Return the text of an entry of the dynamic section, NULL without an entry. */
static const char *text_of(struct link_map *object, const ElfW(Dyn) *entry)
{
    ElfW(Dyn) *strings = entry_of(object, DT_STRTAB);
    uintptr_t start = strings ? strings->d_un.d_ptr : 0;

    return strings && entry ? (char *)(start + (start < object->l_addr ? object->l_addr : 0) + entry->d_un.d_val) : NULL;
}

/* Store a folder of the run path, which may contain $ORIGIN; return 0 if it is unknown. */
static int expand_origin(struct link_map *object, const char *folder, size_t length, char *path)
{
    char origin[PATH_MAX] = "";
    const char *rest = folder;

    if (length && *folder == '$') {
        rest = !strncmp(folder, "$ORIGIN", 7) ? folder + 7 : !strncmp(folder, "${ORIGIN}", 9) ? folder + 9 : NULL;
        if (!rest || !(*object->l_name ? snprintf(origin, sizeof origin, "%s", object->l_name)
                                       : kernel()(SYS_readlinkat, AT_FDCWD, "/proc/self/exe", origin, PATH_MAX - 1)))
            return 0;
        if (strrchr(origin, '/'))
            *strrchr(origin, '/') = 0;
    }
    return snprintf(path, PATH_MAX, "%s%.*s", origin, (int)(folder + length - rest), rest) < PATH_MAX;
}

/* Look for a library in folders as the loader does, and store its path; return 0 if it is elsewhere. */
static int search_libraries(struct link_map *object, const char *folders, const char *name, char *path, int notes)
{
    for (; folders && *folders; folders += folders[strcspn(folders, ":")] == ':') {
        size_t length = strcspn(folders, ":");
        int is_known = expand_origin(object, folders, length, path) && strlen(path) + strlen(name) + 2 < PATH_MAX;
        folders += length;
        if (is_known) {
            strcat(strcat(path, "/"), name);
            if (is_there(path))
                return 1;
            errno = ENOENT;
            if (notes)
                missing(AT_FDCWD, path);
        }
    }
    return 0;
}

static int search_run_path(struct link_map *object, const char *name, char *path)
{
    ElfW(Dyn) *entry = entry_of(object, DT_RUNPATH);

    if (entry && search_libraries(object, NEXT(getenv)("LD_LIBRARY_PATH"), name, path, 0))
        return 0;
    return search_libraries(object, text_of(object, entry ? entry : entry_of(object, DT_RPATH)), name, path, 1);
}

/* Log where the loader has looked in vain for the libraries that an object needs. */
static void note_run_path(struct link_map *object)
{
    char path[PATH_MAX];

    if (entry_of(object, DT_RUNPATH) || entry_of(object, DT_RPATH))
        for (ElfW(Dyn) *each = object->l_ld; each->d_tag != DT_NULL; each++)
            if (each->d_tag == DT_NEEDED)
                search_run_path(object, text_of(object, each), path);
}

/* Return whether a program was written in Go and calls the kernel itself. */
static int is_go(const struct dl_phdr_info *info)
{
    for (const ElfW(Phdr) *part = info->dlpi_phdr; part < info->dlpi_phdr + info->dlpi_phnum; part++) {
        size_t at = 0;
        while (part->p_type == PT_NOTE && part->p_vaddr && at + sizeof(ElfW(Nhdr)) + 4 < part->p_memsz) {
            const ElfW(Nhdr) *mark = (const ElfW(Nhdr) *)(info->dlpi_addr + part->p_vaddr + at);
            if (mark->n_namesz == 4 && !memcmp(mark + 1, "Go", 3))
                return 1;
            at += sizeof *mark + ((mark->n_namesz + 3) & ~3u) + ((mark->n_descsz + 3) & ~3u);
        }
    }
    return 0;
}

/* Log a library, or the program, which has no name. */
static int note_library(struct dl_phdr_info *info, size_t size, void *data)
{
    (void)size, (void)data;
    if (info->dlpi_name && *info->dlpi_name == '/' && strcmp(info->dlpi_name, library)) {
        found('Y', AT_FDCWD, info->dlpi_name);
        note_last_build(info->dlpi_name);
    } else if (info->dlpi_name && !*info->dlpi_name && is_go(info))
        note('B', "a program of Go");
    return 0;
}

static void note_libraries(void)
{
    dl_iterate_phdr(note_library, NULL);
#ifdef __GLIBC__
    for (struct link_map *object = _r_debug.r_map; object; object = object->l_next)
        note_run_path(object);
#endif
}

static int store_variable(const char *name, char *variable, size_t size)
{
    size_t length = strlen(name);

    for (char **entry = environ; entry && *entry; entry++)
        if (!strncmp(*entry, name, length) && strlen(*entry) < size) {
            strcpy(variable, *entry);
            return 1;
        }
    return 0;
}

static char *map_file(const char *path, int writes, size_t *size)
{
    int descriptor = kernel()(SYS_openat, AT_FDCWD, path, (writes ? O_RDWR : O_RDONLY) | O_CLOEXEC);
    struct stat status;
    void *result = MAP_FAILED;

    if (descriptor < 0)
        return NULL;
    if (!fstat(descriptor, &status) && status.st_size > 0) {
        *size = status.st_size;
        result = mmap(NULL, *size, writes ? PROT_READ | PROT_WRITE : PROT_READ,
                      writes ? MAP_SHARED | MAP_NORESERVE : MAP_PRIVATE, descriptor, 0);
    }
    kernel()(SYS_close, descriptor);
    return result == MAP_FAILED ? NULL : result;
}

/* Python lists a folder to find modules or distributions in it, and looks at the names later: its audit hooks report
 * which modules it looks for, and which code lists a folder. The symbols are those of the program or its libpython. */

typedef struct object PyObject;

static struct {
    PyObject *(*item)(PyObject *, ssize_t), *(*list_item)(PyObject *, ssize_t), *(*attribute)(PyObject *, const char *);
    PyObject *(*frame)(void), *none;
    ssize_t (*list_size)(PyObject *);
    const char *(*text)(PyObject *);
    void (*release)(PyObject *), (*clear)(void);
} python;
static uint64_t search_path;
static __thread char is_search;

static const char *python_text(PyObject *object)
{
    const char *text = object ? python.text(object) : NULL;

    if (!text)
        python.clear();
    return text;
}

static void note_import(PyObject *arguments)
{
    const char *name = python_text(python.item(arguments, 0));
    PyObject *list = python.item(arguments, 2);
    char path[1 << 14];
    size_t at = 0;

    if (!name || python.item(arguments, 1) != python.none || list == python.none)
        return;
    for (ssize_t each = 0, count = python.list_size(list); each < count; each++) {
        const char *entry = python_text(python.list_item(list, each));
        if (entry && at + PATH_MAX + 1 < sizeof path && locate(AT_FDCWD, *entry ? entry : ".", path + at)) {
            at += strlen(path + at);
            path[at++] = '\n';
        }
    }
    python.clear();
    if (search_path != hash('I', path, at)) {
        search_path = hash('I', path, at);
        say('I', path, at);
    }
    if (remember_value(hash('M', name, strlen(name)) ^ (search_path & ~1ULL)))
        say('M', name, strlen(name));
}

/* Return whether Python itself looks for modules or distributions. */
static int is_finder(void)
{
    static const char *const finders[] = {
        "<frozen importlib", "<frozen site>", "/site.py", "importlib/metadata", "importlib_metadata/", "/pkg_resources/",
    };
    PyObject *frame = python.frame(), *code = frame ? python.attribute(frame, "f_code") : NULL;
    PyObject *file = code ? python.attribute(code, "co_filename") : NULL;
    const char *name = file ? python_text(file) : NULL;
    int result = 0;

    for (size_t each = 0; name && each < sizeof finders / sizeof *finders; each++)
        result = result || strstr(name, finders[each]);
    if (file)
        python.release(file);
    if (code)
        python.release(code);
    python.clear();
    return result;
}

static int audit(const char *event, PyObject *arguments, void *data)
{
    int saved = errno;

    (void)data;
    if (!strcmp(event, "import"))
        note_import(arguments);
    else if (!strcmp(event, "os.listdir") || !strcmp(event, "os.scandir"))
        is_search = is_finder();
    errno = saved;
    return 0;
}

static void listed(int folder, const char *path)
{
    found(is_search ? 'T' : 'L', folder, path);
    if (is_search)
        found('l', folder, path); /* tests may depend on any of these names */
    is_search = 0;
}

#define PYTHON(member, name) (*(void **)&python.member = dlsym(RTLD_DEFAULT, name))

static void observe_python(void)
{
    int (*add)(int (*)(const char *, PyObject *, void *), void *);

    *(void **)&add = dlsym(RTLD_DEFAULT, "PySys_AddAuditHook");
    if (add && PYTHON(item, "PyTuple_GetItem") && PYTHON(list_item, "PyList_GetItem") && PYTHON(none, "_Py_NoneStruct")
        && PYTHON(list_size, "PyList_Size") && PYTHON(attribute, "PyObject_GetAttrString")
        && PYTHON(frame, "PyEval_GetFrame") && PYTHON(text, "PyUnicode_AsUTF8") && PYTHON(release, "Py_DecRef")
        && PYTHON(clear, "PyErr_Clear"))
        add(audit, NULL);
}

/* Programs that copy the environment: the variables that they use are named in the code that they run. */
static const char *const with_text[] = {"/sh", "/dash", "/bash", "/busybox", "/python", NULL};
static const char *const with_arguments[] = {"/awk", "/gawk", "/mawk", "/perl", "/ruby", "/node", NULL};

static int begins_with_one(const char *name, const char *const *beginnings)
{
    while (*beginnings && strncmp(name, *beginnings, strlen(*beginnings)))
        beginnings++;
    return *beginnings != NULL;
}

/* Log the text after -c, all arguments, or the variable that printenv prints. */
static void note_command(const char *program)
{
    int is_printenv = !strcmp(program, "/printenv"), joins = begins_with_one(program, with_arguments);
    char words[1 << 16];
    int descriptor;
    ssize_t size, flag;

    if (!is_printenv && !joins && !begins_with_one(program, with_text))
        return;
    descriptor = kernel()(SYS_openat, AT_FDCWD, "/proc/self/cmdline", O_RDONLY | O_CLOEXEC);
    if (descriptor < 0)
        return;
    size = kernel()(SYS_read, descriptor, words, sizeof words);
    kernel()(SYS_close, descriptor);
    if (size <= 0 || (words[size - 1] && !joins))
        return;
    words[size - 1] = 0;
    flag = strlen(words) + 1;
    if (flag >= size)
        return;
    for (char *end = words + flag; joins && (end = memchr(end, 0, words + size - 1 - end));)
        *end = ' ';
    if (is_printenv)
        say('V', words + flag, strlen(words + flag));
    else if (joins)
        say('C', words + flag, strlen(words + flag));
    else if (flag + 3 < size && !strcmp(words + flag, "-c"))
        say('C', words + flag + 3, strlen(words + flag + 3));
}

static void note_child_of(long process)
{
    char parent[24];

    say('O', parent, snprintf(parent, sizeof parent, "%ld", process));
}

static void forked(void)
{
    own_process = kernel()(SYS_getpid);
    note_child_of(kernel()(SYS_getppid));
    search_path = 0;
}

/* Compilers and ninja treat the pipe to forge as a terminal if forge writes to one. CMake reads the messages of the
 * compilers that it tries, so there are no colours while it configures. */
static enum { PLAIN, COMPILER, NINJA } colours;

static void decide_on_colours(const char *program)
{
    static const char *const compilers[] = {"/cc1", "/clang", "/f951", "/ld.lld", "/lld", "/mold", NULL};
    char words[PATH_MAX + 16], **variable = environ;
    int descriptor;
    ssize_t size, first;

    while (variable && *variable && strncmp(*variable, COLOURS, sizeof COLOURS - 1))
        variable++;
    if (!variable || !*variable)
        return;
    if (!strcmp(program, "/ninja"))
        colours = NINJA;
    else if (begins_with_one(program, compilers) || strstr(program, "gcc") || strstr(program, "g++"))
        colours = COMPILER;
    else if (!strcmp(program, "/cmake")) {
        descriptor = kernel()(SYS_openat, AT_FDCWD, "/proc/self/cmdline", O_RDONLY | O_CLOEXEC);
        size = descriptor < 0 ? 0 : kernel()(SYS_read, descriptor, words, sizeof words - 1);
        if (descriptor >= 0)
            kernel()(SYS_close, descriptor);
        words[size > 0 ? size : 0] = 0;
        first = strlen(words) + 1;
        if (first >= size || (strcmp(words + first, "--build") && strcmp(words + first, "-E")))
            do
                *variable = variable[1];
            while (*variable++);
    }
}

EXPORT int isatty(int descriptor)
{
    return descriptor == STDERR_FILENO && colours == COMPILER ? 1 : NEXT(isatty)(descriptor);
}

static void note_process(long parent)
{
    char program[PATH_MAX];
    ssize_t size = kernel()(SYS_readlinkat, AT_FDCWD, "/proc/self/exe", program, sizeof program - 1);
    const char *name;

    program[size > 0 ? size : 0] = 0;
    note_last_build(program);
    unstage(program, sizeof program);
    say('P', program, strlen(program));
    own_process = kernel()(SYS_getpid);
    note_child_of(parent);
    name = strrchr(program, '/');
    if (name) {
        note_command(name);
        decide_on_colours(name);
    }
    note_libraries();
}

static void guard_copies(void)
{
    char link[40];
    int descriptor;
    ssize_t size = 0;

    strcpy(backups, log_variable + strlen(LOG));
    strcpy(moved, strrchr(backups, '/'));
    if (strrchr(moved, '.'))
        *strrchr(moved, '.') = 0;
    *strrchr(backups, '/') = 0;
    descriptor = kernel()(SYS_openat, AT_FDCWD, backups, O_PATH | O_CLOEXEC);
    if (descriptor >= 0) {
        snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
        size = kernel()(SYS_readlinkat, AT_FDCWD, link, backups + PATH_MAX, PATH_MAX - 1);
        kernel()(SYS_close, descriptor);
    }
    if (size <= 0)
        strcpy(backups + PATH_MAX, backups);
}

/* Begin to log as a child of a process if the environment names a log. */
static void start(long parent)
{
    int saved = errno;
    Dl_info info;

    if (!map && store_variable(LOG, log_variable, sizeof log_variable)) {
        if (dladdr(log_variable, &info) && info.dli_fname && strlen(info.dli_fname) < sizeof library)
            strcpy(library, info.dli_fname);
        map = map_file(log_variable + strlen(LOG), 1, &map_size);
        if (store_variable(LINKS, links_variable, sizeof links_variable)) {
            size_t size;
            links = map_file(links_variable + strlen(LINKS), 0, &size);
            links_end = links ? links + size : NULL;
            if (links && store_variable(STAGE, stage_variable, sizeof stage_variable)) {
                const char *word = links;
                while (word < links_end && *word)
                    word += strlen(word) + 1;
                if (word < links_end)
                    own = word + 1, own_end = links_end, links_end = word;
                stage = stage_variable + strlen(STAGE);
            }
        }
        if (map) {
            guard_copies();
            is_entry(AT_FDCWD, "/"); /* dlsym() now rather than between dlopen() and dlerror() */
            note_process(parent);
            pthread_atfork(NULL, NULL, forked);
        }
    }
    errno = saved;
}

__attribute__((constructor)) static void load(void)
{
    start(kernel()(SYS_getppid));
    if (map)
        observe_python();
}

/* For observed.py. A server that was started without a log serves a process that has one; return 0 if it cannot
 * log the accesses of that process now. */
EXPORT int forge_observe_for(long process)
{
    if (map)
        return 0;
    start(process);
    return map != NULL;
}

/* Log words that each end with NUL. */
EXPORT void forge_observed(char kind, const char *words, size_t size)
{
    for (const char *word = words; map && word < words + size; word += strlen(word) + 1)
        if (kind == 'W')
            changed(kind, AT_FDCWD, word);
        else
            say(kind, word, strlen(word));
}

/* Open */

#define WRITES (O_WRONLY | O_RDWR | O_CREAT | O_TRUNC)

static mode_t mode_of(int flags, va_list arguments)
{
    return flags & O_CREAT || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(arguments, mode_t) : 0;
}

/* An open file may have another path: links lead there, also those below /proc. */
static void note_place(char kind, int descriptor)
{
    char link[40], path[PATH_MAX];
    int saved = errno;
    ssize_t size;

    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    size = kernel()(SYS_readlinkat, AT_FDCWD, link, path, sizeof path - 1);
    path[size > 0 ? size : 0] = 0;
    if (*path == '/')
        (kind == 'W' ? changed : found)(kind, AT_FDCWD, path);
    errno = saved;
}

/* Log a source whose answers may change without any record of it. */
static void note_channel(const char *word)
{
    size_t length = strlen(word);

    if (map && remember('K', word, length))
        say('K', word, length);
}

static void note_device(int folder, const char *path)
{
    char absolute[PATH_MAX];
    int saved = errno;

    if (map && locate(folder, path, absolute)
        && (!strncmp(absolute, "/sys/", 5) || (!strncmp(absolute, "/dev/", 5) && !is_no_device(absolute))))
        note_channel(absolute);
    errno = saved;
}

static void opened(int result, int folder, const char *path, int flags)
{
    if (result >= 0)
        note_device(folder, path);
    if (result < 0)
        missing(folder, path);
    else if (flags & O_DIRECTORY)
        found('T', folder, path);
    else if (!(flags & WRITES)) {
        found('R', folder, path);
        if (map && (!strncmp(path, "/proc/", 6) || !strncmp(path, "/dev/fd/", 8)))
            note_place('R', result);
    } else {
        if ((flags & (O_CREAT | O_EXCL)) == (O_CREAT | O_EXCL))
            found('n', folder, path);
        if ((flags & (O_ACCMODE | O_TRUNC)) == O_RDWR || (flags & (O_APPEND | O_TRUNC)) == O_APPEND)
            found('R', folder, path);
        changed('W', folder, path);
        if (map)
            note_place('W', result);
    }
}

#define OPEN(name)                                                              \
    EXPORT int name(const char *path, int flags, ...)                           \
    {                                                                           \
        va_list arguments;                                                      \
        int result;                                                             \
        mode_t mode;                                                            \
        va_start(arguments, flags);                                             \
        mode = mode_of(flags, arguments);                                       \
        va_end(arguments);                                                      \
        IN_STAGE(AT_FDCWD, flags & O_CREAT ? CREATES : LOOKS);                                                           \
        result = flags & WRITES && refused(AT_FDCWD, given) ? -1 : NEXT(name)(path, flags, mode); \
        opened(result, AT_FDCWD, given, flags);                                       \
        return result;                                                          \
    }

#define OPENAT(name)                                                            \
    EXPORT int name(int folder, const char *path, int flags, ...)               \
    {                                                                           \
        va_list arguments;                                                      \
        int result;                                                             \
        mode_t mode;                                                            \
        va_start(arguments, flags);                                             \
        mode = mode_of(flags, arguments);                                       \
        va_end(arguments);                                                      \
        IN_STAGE(folder, flags & O_CREAT ? CREATES : LOOKS);                                                       \
        result = flags & WRITES && refused(folder, given) ? -1 : NEXT(name)(folder, path, flags, mode); \
        opened(result, folder, given, flags);                                   \
        return result;                                                          \
    }

#define CREAT(name)                                                             \
    EXPORT int name(const char *path, mode_t mode)                              \
    {                                                                           \
        IN_STAGE(AT_FDCWD, CREATES);                                                     \
        int result = refused(AT_FDCWD, given) ? -1 : NEXT(name)(path, mode);    \
        opened(result, AT_FDCWD, given, O_WRONLY | O_CREAT | O_TRUNC);          \
        return result;                                                          \
    }

static int flags_of(const char *mode)
{
    int more = strchr(mode, '+') ? O_RDWR : *mode == 'r' ? O_RDONLY : O_WRONLY;

    return more | (*mode == 'w' ? O_CREAT | O_TRUNC : *mode == 'a' ? O_CREAT | O_APPEND : 0);
}

#define FOPEN(name)                                                             \
    EXPORT FILE *name(const char *path, const char *mode)                       \
    {                                                                           \
        int flags = flags_of(mode);                                             \
        IN_STAGE(AT_FDCWD, flags & O_CREAT ? CREATES : LOOKS);                                                     \
        FILE *result = flags & WRITES && refused(AT_FDCWD, given) ? NULL : NEXT(name)(path, mode); \
        opened(result ? fileno(result) : -1, AT_FDCWD, given, flags);           \
        return result;                                                          \
    }

#define FREOPEN(name)                                                           \
    EXPORT FILE *name(const char *path, const char *mode, FILE *stream)         \
    {                                                                           \
        int flags = flags_of(mode);                                             \
        IN_STAGE(AT_FDCWD, flags & O_CREAT ? CREATES : LOOKS);                                                     \
        FILE *result = path && flags & WRITES && refused(AT_FDCWD, given) ? NULL : NEXT(name)(path, mode, stream); \
        if (path)                                                               \
            opened(result ? fileno(result) : -1, AT_FDCWD, given, flags);       \
        return result;                                                          \
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
FOPEN(setmntent)

/* Exported functions that the C library calls itself. */
int __open(const char *, int, ...);
int __open64(const char *, int, ...);
OPEN(__open)
OPEN(__open64)

/* Replacements for calls without a mode under _FORTIFY_SOURCE. */
EXPORT int __open_2(const char *path, int flags) { return open(path, flags); }
EXPORT int __open64_2(const char *path, int flags) { return open64(path, flags); }
EXPORT int __openat_2(int folder, const char *path, int flags) { return openat(folder, path, flags); }
EXPORT int __openat64_2(int folder, const char *path, int flags) { return openat64(folder, path, flags); }
#endif

/* Look */

static void looked(int result, int folder, const char *path)
{
    if (result < 0)
        missing(folder, path);
    else if (path && *path)
        found('T', folder, path);
}

#define LOOK(name, folder, parameters, ...)                                     \
    EXPORT int name parameters                                                  \
    {                                                                           \
        IN_STAGE(folder, LOOKS);                                                       \
        int result = NEXT(name)(__VA_ARGS__);                                   \
        looked(result, folder, given);                                          \
        return result;                                                          \
    }

LOOK(stat, AT_FDCWD, (const char *path, struct stat *status), path, status)
LOOK(lstat, AT_FDCWD, (const char *path, struct stat *status), path, status)
LOOK(fstatat, folder, (int folder, const char *path, struct stat *status, int flags), folder, path, status, flags)
LOOK(statvfs, AT_FDCWD, (const char *path, struct statvfs *status), path, status)
LOOK(access, AT_FDCWD, (const char *path, int mode), path, mode)
LOOK(faccessat, folder, (int folder, const char *path, int mode, int flags), folder, path, mode, flags)
#ifdef __GLIBC__
LOOK(stat64, AT_FDCWD, (const char *path, struct stat64 *status), path, status)
LOOK(lstat64, AT_FDCWD, (const char *path, struct stat64 *status), path, status)
LOOK(fstatat64, folder, (int folder, const char *path, struct stat64 *status, int flags), folder, path, status, flags)
LOOK(statfs, AT_FDCWD, (const char *path, struct statfs *status), path, status)
LOOK(statfs64, AT_FDCWD, (const char *path, struct statfs64 *status), path, status)
LOOK(statvfs64, AT_FDCWD, (const char *path, struct statvfs64 *status), path, status)
LOOK(euidaccess, AT_FDCWD, (const char *path, int mode), path, mode)
LOOK(eaccess, AT_FDCWD, (const char *path, int mode), path, mode)
LOOK(statx, folder, (int folder, const char *path, int flags, unsigned int mask, struct statx *status), folder, path, flags, mask, status)

/* The names before glibc 2.33. */
int __xstat(int, const char *, struct stat *);
int __lxstat(int, const char *, struct stat *);
int __xstat64(int, const char *, struct stat64 *);
int __lxstat64(int, const char *, struct stat64 *);
int __fxstatat(int, int, const char *, struct stat *, int);
int __fxstatat64(int, int, const char *, struct stat64 *, int);
LOOK(__xstat, AT_FDCWD, (int version, const char *path, struct stat *status), version, path, status)
LOOK(__lxstat, AT_FDCWD, (int version, const char *path, struct stat *status), version, path, status)
LOOK(__xstat64, AT_FDCWD, (int version, const char *path, struct stat64 *status), version, path, status)
LOOK(__lxstat64, AT_FDCWD, (int version, const char *path, struct stat64 *status), version, path, status)
LOOK(__fxstatat, folder, (int version, int folder, const char *path, struct stat *status, int flags), version, folder, path, status, flags)
LOOK(__fxstatat64, folder, (int version, int folder, const char *path, struct stat64 *status, int flags), version, folder, path, status, flags)
#endif

/* The targets of links below /proc are in the stage. */
static ssize_t unstaged_target(ssize_t result, char *target, size_t size)
{
    char path[PATH_MAX];
    size_t length;

    if (!stage || result <= 0 || result >= PATH_MAX || *target != '/')
        return result;
    memcpy(path, target, result);
    path[result] = 0;
    length = unstage(path, sizeof path);
    if (length > size)
        length = size;
    memcpy(target, path, length);
    return length;
}

#define READ_LINK(name, folder, parameters, ...)                                \
    EXPORT ssize_t name parameters                                              \
    {                                                                           \
        IN_STAGE(folder, LOOKS);                                                       \
        ssize_t result = NEXT(name)(__VA_ARGS__);                               \
        looked(result < 0 ? -1 : 0, folder, given);                             \
        return unstaged_target(result, target, size);                           \
    }

READ_LINK(readlink, AT_FDCWD, (const char *path, char *target, size_t size), path, target, size)
READ_LINK(readlinkat, folder, (int folder, const char *path, char *target, size_t size), folder, path, target, size)

/* Links in the path may lead elsewhere later. */
static void resolved_to(const char *result, const char *path)
{
    char absolute[PATH_MAX], target[2];
    int saved = errno;

    looked(result ? 0 : -1, AT_FDCWD, path);
    if (map && result && locate(AT_FDCWD, path, absolute) && strcmp(result, absolute))
        for (char *at = absolute + 1; (at = strchr(at, '/')); at++) {
            *at = 0;
            if (kernel()(SYS_readlinkat, AT_FDCWD, absolute, target, sizeof target) > 0)
                found('T', AT_FDCWD, absolute);
            *at = '/';
        }
    errno = saved;
}

/* A path in the stage is reported as one in the prefix; the result may then be longer. */
static char *unstaged_path(char *result, char *resolved)
{
    char path[PATH_MAX];

    if (!stage || !result || !is_below(result, stage) || strlen(result) >= sizeof path)
        return result;
    strcpy(path, result);
    unstage(path, sizeof path);
    if (resolved)
        return strcpy(resolved, path);
    free(result);
    return strdup(path);
}

#define RESOLVE(name, resolved, parameters, ...)                                \
    EXPORT char *name parameters                                                \
    {                                                                           \
        IN_STAGE(AT_FDCWD, LOOKS);                                                     \
        char *result = unstaged_path(NEXT(name)(__VA_ARGS__), resolved);        \
        resolved_to(result, given);                                             \
        return result;                                                          \
    }

RESOLVE(realpath, resolved, (const char *path, char *resolved), path, resolved)
#ifdef __GLIBC__
char *__realpath_chk(const char *, char *, size_t);
char *__getcwd_chk(char *, size_t, size_t);
RESOLVE(__realpath_chk, resolved, (const char *path, char *resolved, size_t size), path, resolved, size)
RESOLVE(canonicalize_file_name, NULL, (const char *path), path)
#endif

EXPORT char *getcwd(char *path, size_t size)
{
    char place[PATH_MAX], *result;

    if (!stage || !NEXT(getcwd)(place, sizeof place) || !is_below(place, stage))
        return NEXT(getcwd)(path, size);
    unstage(place, sizeof place);
    if (size && strlen(place) >= size) {
        errno = ERANGE;
        return NULL;
    }
    result = path ? path : malloc(size ? size : strlen(place) + 1);
    return result ? strcpy(result, place) : NULL;
}

EXPORT char *get_current_dir_name(void) { return getcwd(NULL, 0); }
#ifdef __GLIBC__
EXPORT char *__getcwd_chk(char *path, size_t size, size_t whole) { return getcwd(path, size < whole ? size : whole); }
#endif

/* List */

/* Open folders of a shared prefix, with the folder that contains the other names. */
static struct listing {
    DIR *dir, *other, *real, *staged;
    char *rest; /* below the prefix */
} listings[64];
static pthread_mutex_t listing_lock = PTHREAD_MUTEX_INITIALIZER;

static struct listing *listing_of(DIR *dir)
{
    if (own)
        for (struct listing *each = listings; each < listings + sizeof listings / sizeof *listings; each++)
            if (each->dir == dir)
                return each;
    return NULL;
}

static void join_names(DIR *dir, int folder, const char *path)
{
    char absolute[PATH_MAX], place[PATH_MAX], link[40];
    int saved = errno, is_staged = 0;
    ssize_t size;

    if (dir && own && locate(folder, path, absolute))
        for (const char *prefix = links; prefix < links_end; prefix += strlen(prefix) + 1)
            if (is_below(absolute, prefix)) {
                const char *rest = absolute + strlen(prefix);
                struct listing *listing;
                struct stat status;
                DIR *other = NULL;
                snprintf(link, sizeof link, "/proc/self/fd/%d", dirfd(dir));
                size = kernel()(SYS_readlinkat, AT_FDCWD, link, place, sizeof place - 1);
                place[size > 0 ? size : 0] = 0;
                is_staged = is_below(place, stage);
                if (!is_staged && strlen(stage) + strlen(rest) < sizeof place) {
                    snprintf(place, sizeof place, "%s%s", stage, rest);
                    other = NEXT(opendir)(place);
                } else if (is_of_others(absolute, rest, &status))
                    other = NEXT(opendir)(absolute);
                pthread_mutex_lock(&listing_lock);
                listing = listing_of(NULL);
                if (listing)
                    *listing = (struct listing){dir, other, is_staged ? other : dir, is_staged ? dir : other, strdup(rest)};
                pthread_mutex_unlock(&listing_lock);
                if (!listing)
                    note('B', "many open folders");
                break;
            }
    errno = saved;
}

/* Return whether to list a name: not one of this package in the prefix, nor one that both folders contain. */
static int is_listed(struct listing *listing, int in_real, const char *name)
{
    char path[PATH_MAX];
    struct stat status;

    if (!strcmp(name, ".") || !strcmp(name, ".."))
        return in_real == (listing->dir == listing->real);
    if (!in_real)
        return 1;
    snprintf(path, sizeof path, "%s%s%s", listing->rest[0] ? listing->rest + 1 : "", listing->rest[0] ? "/" : "", name);
    return !is_own(path)
        && !(listing->staged && !NEXT(fstatat)(dirfd(listing->staged), name, &status, AT_SYMLINK_NOFOLLOW));
}

#define READ_FOLDER(name, entry)                                                \
    EXPORT struct entry *name(DIR *dir)                                         \
    {                                                                           \
        struct listing *listing = listing_of(dir);                              \
        struct entry *result;                                                   \
        DIR *from = dir;                                                        \
        if (!listing)                                                           \
            return NEXT(name)(dir);                                             \
        for (;;) {                                                              \
            int saved = errno;                                                  \
            while ((result = NEXT(name)(from)))                                 \
                if (is_listed(listing, from == listing->real, result->d_name))  \
                    return result;                                              \
            if (from == listing->other || !listing->other)                      \
                return NULL;                                                    \
            errno = saved;                                                      \
            from = listing->other;                                              \
        }                                                                       \
    }

READ_FOLDER(readdir, dirent)
#ifdef __GLIBC__
READ_FOLDER(readdir64, dirent64)
#endif

EXPORT int closedir(DIR *dir)
{
    struct listing *listing;

    pthread_mutex_lock(&listing_lock);
    listing = listing_of(dir);
    if (listing) {
        if (listing->other)
            NEXT(closedir)(listing->other);
        free(listing->rest);
        *listing = (struct listing){NULL, NULL, NULL, NULL, NULL};
    }
    pthread_mutex_unlock(&listing_lock);
    return NEXT(closedir)(dir);
}

EXPORT void rewinddir(DIR *dir)
{
    struct listing *listing = listing_of(dir);

    if (listing && listing->other)
        NEXT(rewinddir)(listing->other);
    NEXT(rewinddir)(dir);
}

EXPORT DIR *opendir(const char *path)
{
    IN_STAGE(AT_FDCWD, LOOKS);
    DIR *result = NEXT(opendir)(path);
    join_names(result, AT_FDCWD, given);
    if (result)
        listed(AT_FDCWD, given);
    else
        missing(AT_FDCWD, given);
    return result;
}

EXPORT DIR *fdopendir(int descriptor)
{
    DIR *result = NEXT(fdopendir)(descriptor);
    join_names(result, descriptor, ".");
    if (result)
        listed(descriptor, ".");
    return result;
}

#define SCAN(name, folder, entry, parameters, ...)                              \
    EXPORT int name parameters                                                  \
    {                                                                           \
        IN_STAGE(folder, LOOKS);                                                \
        int result = NEXT(name)(__VA_ARGS__);                                   \
        if (own && path != given)                                               \
            note('B', "scandir");                                               \
        if (result < 0)                                                         \
            missing(folder, given);                                             \
        else                                                                    \
            found('L', folder, given);                                          \
        return result;                                                          \
    }
#define SCANS(entry) struct entry ***names, int (*select)(const struct entry *), int (*compare)(const struct entry **, const struct entry **)

SCAN(scandir, AT_FDCWD, dirent, (const char *path, SCANS(dirent)), path, names, select, compare)
#ifdef __GLIBC__
SCAN(scandir64, AT_FDCWD, dirent64, (const char *path, SCANS(dirent64)), path, names, select, compare)
SCAN(scandirat, folder, dirent, (int folder, const char *path, SCANS(dirent)), folder, path, names, select, compare)
SCAN(scandirat64, folder, dirent64, (int folder, const char *path, SCANS(dirent64)), folder, path, names, select, compare)

EXPORT ssize_t getdents64(int folder, void *entries, size_t size)
{
    return syscall(SYS_getdents64, folder, entries, size);
}
#endif

/* glob() calls functions inside the C library unless others are passed: these are the observed ones above. */
static void note_pattern(const char *pattern)
{
    if (pattern[strcspn(pattern, "*?[{~")])
        return;
    if (is_entry(AT_FDCWD, pattern))
        found('T', AT_FDCWD, pattern);
    else {
        errno = ENOENT;
        missing(AT_FDCWD, pattern);
    }
}

#define GLOB_CALL(name, type, look, look_at_link, next)                         \
    EXPORT int name(const char *pattern, int flags, int (*failed)(const char *, int), type *paths) \
    {                                                                           \
        note_pattern(pattern);                                                  \
        if (!(flags & GLOB_ALTDIRFUNC)) {                                       \
            paths->gl_opendir = (void *(*)(const char *))opendir;               \
            paths->gl_closedir = (void (*)(void *))(void *)closedir;            \
            paths->gl_readdir = (__typeof__(paths->gl_readdir))(void *)next;    \
            paths->gl_stat = look;                                              \
            paths->gl_lstat = look_at_link;                                     \
        }                                                                       \
        return NEXT(name)(pattern, flags | GLOB_ALTDIRFUNC, failed, paths);     \
    }

static int note_visit(const char *path, const struct stat *status, int kind, struct FTW *place)
{
    (void)status, (void)place;
    found(kind == FTW_D ? 'L' : 'T', AT_FDCWD, path);
    return 0;
}

/* The C library walks folders internally, and passes the paths to a callback. */
static void note_walk(const char *path)
{
    char absolute[PATH_MAX];

    for (const char *prefix = links; stage && prefix < links_end; prefix += strlen(prefix) + 1)
        if (locate(AT_FDCWD, path, absolute) && (is_below(absolute, prefix) || is_below(prefix, absolute)))
            note('B', "a walk");
}

/* Walk the folders once beforehand, to log them. */
#define WALK(name, flags, parameters, ...)                                      \
    EXPORT int name parameters                                                  \
    {                                                                           \
        note_walk(path);                                                        \
        if (map && NEXT(nftw)(path, note_visit, 16, flags))                     \
            missing(AT_FDCWD, path);                                            \
        return NEXT(name)(__VA_ARGS__);                                         \
    }

#define OF_WALK (flags & (FTW_PHYS | FTW_MOUNT))
WALK(ftw, 0, (const char *path, __ftw_func_t visit, int descriptors), path, visit, descriptors)
WALK(nftw, OF_WALK, (const char *path, __nftw_func_t visit, int descriptors, int flags), path, visit, descriptors, flags)
#ifdef __GLIBC__
GLOB_CALL(glob, glob_t, stat, lstat, readdir)
GLOB_CALL(glob64, glob64_t, stat64, lstat64, readdir64)
WALK(ftw64, 0, (const char *path, __ftw64_func_t visit, int descriptors), path, visit, descriptors)
WALK(nftw64, OF_WALK, (const char *path, __nftw64_func_t visit, int descriptors, int flags), path, visit, descriptors, flags)

static void note_visited(const FTSENT *entry)
{
    if (entry && entry->fts_info == FTS_NS) {
        errno = entry->fts_errno;
        missing(AT_FDCWD, entry->fts_path);
    } else if (entry && entry->fts_info != FTS_DP)
        found(entry->fts_info == FTS_D ? 'L' : 'T', AT_FDCWD, entry->fts_accpath);
}

EXPORT FTS *fts_open(char *const *paths, int options, int (*compare)(const FTSENT **, const FTSENT **))
{
    for (char *const *path = paths; *path; path++)
        note_walk(*path);
    return NEXT(fts_open)(paths, options, compare);
}

EXPORT FTSENT *fts_read(FTS *walk)
{
    FTSENT *result = NEXT(fts_read)(walk);
    int saved = errno;

    note_visited(result);
    errno = saved;
    return result;
}

EXPORT FTSENT *fts_children(FTS *walk, int options)
{
    note('B', "fts_children");
    return NEXT(fts_children)(walk, options);
}

/* The C library expands patterns and variables internally. */
EXPORT int wordexp(const char *words, wordexp_t *result, int flags)
{
    int code = NEXT(wordexp)(words, result, flags), saved = errno;
    size_t first = flags & WRDE_DOOFFS ? result->we_offs : 0;

    if (words[strcspn(words, "$`?[")] || strstr(words, "*/"))
        note('B', "wordexp");
    for (size_t each = 0; !code && words[strcspn(words, "*?[")] && each < result->we_wordc; each++) {
        char folder[PATH_MAX];

        snprintf(folder, sizeof folder, "%s", result->we_wordv[first + each]);
        if (strchr(folder, '/'))
            *strrchr(folder, '/') = 0;
        else
            strcpy(folder, ".");
        found('L', AT_FDCWD, *folder ? folder : "/");
    }
    errno = saved;
    return code;
}
#else
EXPORT int glob(const char *pattern, int flags, int (*failed)(const char *, int), glob_t *paths)
{
    note_pattern(pattern);
    if (pattern[strcspn(pattern, "*?[{~")])
        note('B', "glob");
    return NEXT(glob)(pattern, flags, failed, paths);
}
#endif

#ifdef __GLIBC__
/* The loader searches the run path of its caller, which would be this library. */
static void *open_by_run_path(const char *name, int flags, const void *caller)
{
    struct link_map *object;
    char path[PATH_MAX], place[PATH_MAX];
    Dl_info info;
    void *loaded = NEXT(dlopen)(name, RTLD_LAZY | RTLD_NOLOAD);

    if (loaded)
        NEXT(dlclose)(loaded);
    else if (dladdr1(caller, &info, (void **)&object, RTLD_DL_LINKMAP) && search_run_path(object, name, path))
        return NEXT(dlopen)(staged(AT_FDCWD, path, place), flags);
    return NULL;
}
#endif

EXPORT void *dlopen(const char *path, int flags)
{
    char place[PATH_MAX];
    void *result = NULL;
    struct link_map *library;
    int saved = errno;

#ifdef __GLIBC__
    if (path && !strchr(path, '/'))
        result = open_by_run_path(path, flags, __builtin_return_address(0));
#endif
    if (!result)
        result = NEXT(dlopen)(path && strchr(path, '/') ? staged(AT_FDCWD, path, place) : path, flags);
    if (result && path) {
        /* A library that a program loads explicitly, such as a Python module, is read like any other file. */
        if (!dlinfo(result, RTLD_DI_LINKMAP, &library) && strchr(library->l_name, '/')) {
            found('R', AT_FDCWD, library->l_name);
            note_run_path(library);
        }
        dl_iterate_phdr(note_library, NULL);
    } else if (path && strchr(path, '/'))
        attempted(AT_FDCWD, path);
    errno = saved;
    return result;
}

#ifdef __GLIBC__
/* Another namespace has its own C library. */
EXPORT void *dlmopen(Lmid_t space, const char *path, int flags)
{
    if (space != LM_ID_BASE)
        note('B', "another C library");
    return NEXT(dlmopen)(space, path, flags);
}
#endif

EXPORT int chdir(const char *path)
{
    char place[PATH_MAX];

    attempted(AT_FDCWD, path);
    return NEXT(chdir)(staged(AT_FDCWD, path, place));
}

/* Change */

static int note_entry(const char *path, const struct stat *status, int kind, struct FTW *place)
{
    (void)status, (void)place;
    changed(kind == FTW_D || kind == FTW_DNR ? 'D' : 'W', AT_FDCWD, path);
    return 0;
}

/* Log a renamed path and everything in it: entries that others add later are not the step's. */
static void renamed(int folder, const char *path)
{
    char absolute[PATH_MAX], place[PATH_MAX];
    int saved = errno;

    if (map && locate(folder, path, absolute)
        && NEXT(nftw)(staged(AT_FDCWD, absolute, place), note_entry, 16, FTW_PHYS | FTW_MOUNT))
        changed('W', AT_FDCWD, absolute);
    errno = saved;
}

#define BOTH_IN_STAGE(from, folder)                                             \
    IN_STAGE(folder, CREATES);                                                           \
    char old_place[PATH_MAX];                                                   \
    const char *given_old = old;                                                \
    old = staged(from, old, old_place)

#define RENAME(name, from, folder, parameters, ...)                             \
    EXPORT int name parameters                                                  \
    {                                                                           \
        BOTH_IN_STAGE(from, folder);                                            \
        int result = holds_copies(from, given_old) || refused(from, given_old) || refused(folder, given) \
            ? -1 : NEXT(name)(__VA_ARGS__);                                     \
        if (!result) {                                                          \
            changed('U', from, given_old);                                      \
            renamed(folder, given);                                             \
        } else {                                                                \
            attempted(from, given_old);                                         \
            attempted(folder, given);                                           \
        }                                                                       \
        return result;                                                          \
    }

RENAME(rename, AT_FDCWD, AT_FDCWD, (const char *old, const char *path), old, path)
RENAME(renameat, from, folder, (int from, const char *old, int folder, const char *path), from, old, folder, path)
#ifdef __GLIBC__
RENAME(renameat2, from, folder, (int from, const char *old, int folder, const char *path, unsigned int flags), from, old, folder, path, flags)
#endif

#define CHANGE(name, kind, guard, folder, parameters, ...)                      \
    EXPORT int name parameters                                                  \
    {                                                                           \
        IN_STAGE(folder, kind == 'D' ? CREATES : kind == 'W' ? ALTERS : LOOKS);                                                       \
        int keep = (guard) && (refused(folder, given) || (kind == 'U' && holds_copies(folder, given))); \
        int result = keep ? -1 : NEXT(name)(__VA_ARGS__);                       \
        if (!result)                                                            \
            changed(kind, folder, given);                                       \
        else                                                                    \
            attempted(folder, given);                                           \
        return result;                                                          \
    }

CHANGE(unlink, 'U', is_entry(AT_FDCWD, path), AT_FDCWD, (const char *path), path)
CHANGE(rmdir, 'U', is_entry(AT_FDCWD, path), AT_FDCWD, (const char *path), path)
CHANGE(remove, 'U', is_entry(AT_FDCWD, path), AT_FDCWD, (const char *path), path)
CHANGE(unlinkat, 'U', is_entry(folder, path), folder, (int folder, const char *path, int flags), folder, path, flags)
CHANGE(mkdir, 'D', !is_entry(AT_FDCWD, path), AT_FDCWD, (const char *path, mode_t mode), path, mode)
CHANGE(mkdirat, 'D', !is_entry(folder, path), folder, (int folder, const char *path, mode_t mode), folder, path, mode)
CHANGE(truncate, 'W', 1, AT_FDCWD, (const char *path, off_t size), path, size)
#ifdef __GLIBC__
CHANGE(truncate64, 'W', 1, AT_FDCWD, (const char *path, off64_t size), path, size)
#endif
CHANGE(chmod, 'W', 1, AT_FDCWD, (const char *path, mode_t mode), path, mode)
CHANGE(fchmodat, 'W', 1, folder, (int folder, const char *path, mode_t mode, int flags), folder, path, mode, flags)

#define LINK(name, from, folder, parameters, ...)                               \
    EXPORT int name parameters                                                  \
    {                                                                           \
        BOTH_IN_STAGE(from, folder);                                            \
        int result = refused(folder, given) ? -1 : NEXT(name)(__VA_ARGS__);     \
        if (!result) {                                                          \
            found('R', from, given_old);                                        \
            found('n', folder, given);                                          \
            changed('W', folder, given);                                        \
        } else {                                                                \
            attempted(from, given_old);                                         \
            attempted(folder, given);                                           \
        }                                                                       \
        return result;                                                          \
    }

LINK(link, AT_FDCWD, AT_FDCWD, (const char *old, const char *path), old, path)
LINK(linkat, from, folder, (int from, const char *old, int folder, const char *path, int flags), from, old, folder, path, flags)

/* A file opened through a link of this step is a different file. */
static void note_target(int folder, const char *path, const char *target)
{
    char absolute[2 * PATH_MAX] = "/", place[PATH_MAX];
    struct stat status;
    int saved = errno;

    if (map && (*target == '/' || locate(folder, path, absolute)) && strlen(target) < PATH_MAX) {
        strcpy(strrchr(absolute, '/') + (*target != '/'), target);
        if (strlen(absolute) < PATH_MAX && !NEXT(fstatat)(AT_FDCWD, staged(AT_FDCWD, absolute, place), &status, 0)
            && S_ISREG(status.st_mode))
            found('R', AT_FDCWD, absolute);
    }
    errno = saved;
}

#define CREATE(name, folder, parameters, ...)                                   \
    EXPORT int name parameters                                                  \
    {                                                                           \
        IN_STAGE(folder, CREATES);                                                       \
        int result = refused(folder, given) ? -1 : NEXT(name)(__VA_ARGS__);     \
        if (!result) {                                                          \
            found('n', folder, given);                                          \
            changed('W', folder, given);                                        \
        } else                                                                  \
            attempted(folder, given);                                           \
        return result;                                                          \
    }

EXPORT int symlinkat(const char *target, int folder, const char *path)
{
    IN_STAGE(folder, CREATES);
    int result = refused(folder, given) ? -1 : NEXT(symlinkat)(target, folder, path);

    if (!result) {
        note_target(folder, given, target);
        found('n', folder, given);
        changed('W', folder, given);
    } else
        attempted(folder, given);
    return result;
}

EXPORT int symlink(const char *target, const char *path) { return symlinkat(target, AT_FDCWD, path); }

CREATE(mkfifo, AT_FDCWD, (const char *path, mode_t mode), path, mode)
CREATE(mknod, AT_FDCWD, (const char *path, mode_t mode, dev_t device), path, mode, device)

/* Times and owners are not content. */
#define IN_PLACE(type, name, folder, parameters, ...)                           \
    EXPORT type name parameters                                                 \
    {                                                                           \
        char place[PATH_MAX];                                                   \
        path = lead(folder, path, place, ALTERS);                                     \
        return NEXT(name)(__VA_ARGS__);                                         \
    }

IN_PLACE(int, utimensat, folder, (int folder, const char *path, const struct timespec times[2], int flags), folder, path, times, flags)
IN_PLACE(int, futimesat, folder, (int folder, const char *path, const struct timeval times[2]), folder, path, times)
IN_PLACE(int, utimes, AT_FDCWD, (const char *path, const struct timeval times[2]), path, times)
IN_PLACE(int, lutimes, AT_FDCWD, (const char *path, const struct timeval times[2]), path, times)
IN_PLACE(int, utime, AT_FDCWD, (const char *path, const struct utimbuf *times), path, times)
IN_PLACE(int, chown, AT_FDCWD, (const char *path, uid_t user, gid_t group), path, user, group)
IN_PLACE(int, lchown, AT_FDCWD, (const char *path, uid_t user, gid_t group), path, user, group)
IN_PLACE(int, fchownat, folder, (int folder, const char *path, uid_t user, gid_t group, int flags), folder, path, user, group, flags)
IN_PLACE(long, pathconf, AT_FDCWD, (const char *path, int name), path, name)
IN_PLACE(ssize_t, getxattr, AT_FDCWD, (const char *path, const char *name, void *value, size_t size), path, name, value, size)
IN_PLACE(ssize_t, lgetxattr, AT_FDCWD, (const char *path, const char *name, void *value, size_t size), path, name, value, size)
IN_PLACE(ssize_t, listxattr, AT_FDCWD, (const char *path, char *list, size_t size), path, list, size)
IN_PLACE(ssize_t, llistxattr, AT_FDCWD, (const char *path, char *list, size_t size), path, list, size)
IN_PLACE(int, setxattr, AT_FDCWD, (const char *path, const char *name, const void *value, size_t size, int flags), path, name, value, size, flags)
IN_PLACE(int, lsetxattr, AT_FDCWD, (const char *path, const char *name, const void *value, size_t size, int flags), path, name, value, size, flags)

/* These write the chosen name into the path. */
static void note_temporary(char kind, int failed, char *given, const char *place)
{
    int saved = errno;

    if (place != given)
        strcpy(strchr(given, '/') ? strrchr(given, '/') + 1 : given, strrchr(place, '/') + 1);
    if (!failed)
        changed(kind, AT_FDCWD, given);
    errno = saved;
}

#define TEMPORARY(name, parameters, ...)                                        \
    EXPORT int name parameters                                                  \
    {                                                                           \
        char place[PATH_MAX], *given = path;                                    \
        int result;                                                             \
        path = (char *)lead(AT_FDCWD, path, place, CREATES);                           \
        result = NEXT(name)(__VA_ARGS__);                                       \
        note_temporary('W', result < 0, given, path);                           \
        return result;                                                          \
    }

TEMPORARY(mkstemp, (char *path), path)
TEMPORARY(mkostemp, (char *path, int flags), path, flags)
TEMPORARY(mkstemps, (char *path, int length), path, length)
TEMPORARY(mkostemps, (char *path, int length, int flags), path, length, flags)
#ifdef __GLIBC__
TEMPORARY(mkstemp64, (char *path), path)
TEMPORARY(mkostemp64, (char *path, int flags), path, flags)
#endif

EXPORT char *mkdtemp(char *path)
{
    char place[PATH_MAX], *there = (char *)lead(AT_FDCWD, path, place, CREATES), *result = NEXT(mkdtemp)(there);

    note_temporary('D', !result, path, there);
    return result ? path : NULL;
}

/* Sockets */

EXPORT int socket(int domain, int type, int protocol)
{
    if (domain != AF_UNIX)
        note_channel(domain == AF_INET || domain == AF_INET6 ? "the network" : "a socket of the kernel");
    return NEXT(socket)(domain, type, protocol);
}

/* Host names come from a server, whichever function requests them. */
#define RESOLVES(name, type, parameters, ...)                                   \
    EXPORT type name parameters                                                 \
    {                                                                           \
        note_channel("the network");                                            \
        return NEXT(name)(__VA_ARGS__);                                         \
    }

RESOLVES(getaddrinfo, int,
         (const char *host, const char *service, const struct addrinfo *hints, struct addrinfo **result),
         host, service, hints, result)
RESOLVES(getnameinfo, int,
         (const struct sockaddr *address, socklen_t size, char *host, socklen_t hosts, char *service, socklen_t services,
          int flags),
         address, size, host, hosts, service, services, flags)
RESOLVES(gethostbyname, struct hostent *, (const char *host), host)
RESOLVES(gethostbyname2, struct hostent *, (const char *host, int family), host, family)
RESOLVES(gethostbyaddr, struct hostent *, (const void *address, socklen_t size, int family), address, size, family)
RESOLVES(gethostbyname_r, int,
         (const char *host, struct hostent *entry, char *buffer, size_t size, struct hostent **result, int *code),
         host, entry, buffer, size, result, code)
RESOLVES(gethostbyname2_r, int,
         (const char *host, int family, struct hostent *entry, char *buffer, size_t size, struct hostent **result,
          int *code),
         host, family, entry, buffer, size, result, code)
RESOLVES(gethostbyaddr_r, int,
         (const void *address, socklen_t length, int family, struct hostent *entry, char *buffer, size_t size,
          struct hostent **result, int *code),
         address, length, family, entry, buffer, size, result, code)

EXPORT mqd_t mq_open(const char *name, int flags, ...)
{
    struct mq_attr *attributes = NULL;
    va_list arguments;
    mode_t mode = 0;

    va_start(arguments, flags);
    if (flags & O_CREAT) {
        mode = va_arg(arguments, mode_t);
        attributes = va_arg(arguments, struct mq_attr *);
    }
    va_end(arguments);
    note_channel("a message queue");
    return NEXT(mq_open)(name, flags, mode, attributes);
}

EXPORT sem_t *sem_open(const char *name, int flags, ...)
{
    va_list arguments;
    unsigned int value = 0;
    mode_t mode = 0;

    va_start(arguments, flags);
    if (flags & O_CREAT) {
        mode = va_arg(arguments, mode_t);
        value = va_arg(arguments, unsigned int);
    }
    va_end(arguments);
    if (!(flags & O_EXCL))
        note_channel("a semaphore");
    return NEXT(sem_open)(name, flags, mode, value);
}

EXPORT int shm_open(const char *name, int flags, mode_t mode)
{
    if (!(flags & O_EXCL))
        note_channel("shared memory");
    return NEXT(shm_open)(name, flags, mode);
}

/* The server of a local socket may not be a process of the step. */
static void note_server(const struct sockaddr *address, socklen_t size)
{
    const struct sockaddr_un *local = (const struct sockaddr_un *)address;
    char name[sizeof local->sun_path + 1] = "", path[PATH_MAX];
    size_t length = size > offsetof(struct sockaddr_un, sun_path) ? size - offsetof(struct sockaddr_un, sun_path) : 0;
    int saved = errno;

    if (map && address && length && length < sizeof name && address->sa_family == AF_UNIX) {
        memcpy(name, local->sun_path, length);
        note_channel(locate(AT_FDCWD, name, path) ? path : "an abstract socket");
    }
    errno = saved;
}

#ifdef __GLIBC__
EXPORT int connect(int descriptor, __CONST_SOCKADDR_ARG address, socklen_t size)
{
    note_server(address.__sockaddr__, size);
    return NEXT(connect)(descriptor, address, size);
}
#else
EXPORT int connect(int descriptor, const struct sockaddr *address, socklen_t size)
{
    note_server(address, size);
    return NEXT(connect)(descriptor, address, size);
}
#endif

#ifdef __GLIBC__
EXPORT ssize_t sendto(int descriptor, const void *content, size_t size, int flags, __CONST_SOCKADDR_ARG address,
                      socklen_t length)
{
    note_server(address.__sockaddr__, length);
    return NEXT(sendto)(descriptor, content, size, flags, address, length);
}
#else
EXPORT ssize_t sendto(int descriptor, const void *content, size_t size, int flags, const struct sockaddr *address,
                      socklen_t length)
{
    note_server(address, length);
    return NEXT(sendto)(descriptor, content, size, flags, address, length);
}
#endif

EXPORT ssize_t sendmsg(int descriptor, const struct msghdr *message, int flags)
{
    note_server(message->msg_name, message->msg_namelen);
    return NEXT(sendmsg)(descriptor, message, flags);
}

/* Variables. Shells and Python copy all of them at their start and request none. */

EXPORT char *getenv(const char *name)
{
    if (colours == NINJA && !strcmp(name, "CLICOLOR_FORCE"))
        return (char *)"1";
    if (colours == COMPILER && !strcmp(name, "GCC_URLS"))
        return (char *)"no"; /* hyperlinks are not colours */
    if (map)
        note('V', name);
    return NEXT(getenv)(name);
}

#ifdef __GLIBC__
EXPORT char *secure_getenv(const char *name)
{
    if (map)
        note('V', name);
    return NEXT(secure_getenv)(name);
}
#endif

/* Programs */

static int has_variable(char *const *variables, const char *variable)
{
    size_t length = strcspn(variable, "=") + 1;

    for (; *variables; variables++)
        if (!strncmp(*variables, variable, length))
            return length == sizeof PRELOAD - 1 ? strstr(*variables, library) != NULL : 1;
    return 0;
}

/* Programs that clear the environment, such as `env -i`, still pass these on. */
#define WITH_OBSERVER(variables)                                                \
    char preload[sizeof PRELOAD + PATH_MAX];                                    \
    do {                                                                        \
        size_t count = 0, at = 0;                                               \
        char **copy;                                                            \
        if (!map)                                                               \
            break;                                                              \
        if (variables && has_variable(variables, PRELOAD) && has_variable(variables, LOG)) \
            break;                                                              \
        while (variables && variables[count])                                   \
            count++;                                                            \
        copy = alloca((count + 5) * sizeof *copy);                              \
        for (size_t each = 0; each < count; each++)                             \
            if (strncmp(variables[each], PRELOAD, sizeof PRELOAD - 1) && strncmp(variables[each], LOG, sizeof LOG - 1)) \
                copy[at++] = variables[each];                                   \
        snprintf(preload, sizeof preload, PRELOAD "%s", library);               \
        copy[at++] = preload;                                                   \
        copy[at++] = log_variable;                                              \
        if (*links_variable)                                                    \
            copy[at++] = links_variable;                                        \
        if (*stage_variable)                                                    \
            copy[at++] = stage_variable;                                        \
        copy[at] = NULL;                                                        \
        variables = copy;                                                       \
    } while (0)

/* execvp() and posix_spawnp() search PATH inside the C library, unobserved; store the path of the program. */
static void note_search(const char *file, char *candidate)
{
    const char *path = strchr(file, '/') ? NULL : NEXT(getenv)("PATH");
    int saved = errno;

    *candidate = 0;
    while (path && *path) {
        size_t length = strcspn(path, ":");
        if (length + strlen(file) + 2 < PATH_MAX) {
            snprintf(candidate, PATH_MAX, "%.*s%s%s", (int)length, path, length ? "/" : "", file);
            if (is_there(candidate))
                break;
            errno = ENOENT;
            missing(AT_FDCWD, candidate);
        }
        path += length + (path[length] == ':');
    }
    errno = saved;
}

/* Return whether a program loads this library: not if it is static, for another processor, or runs as another user. */
static int loads_library(const char *file, int depth)
{
    char start[4096] = "", place[PATH_MAX];
    ElfW(Ehdr) *header = (ElfW(Ehdr) *)start;
    struct stat status;
    int descriptor = kernel()(SYS_openat, AT_FDCWD, staged(AT_FDCWD, file, place), O_RDONLY | O_CLOEXEC);
    ssize_t size = descriptor < 0 ? 0 : kernel()(SYS_read, descriptor, start, sizeof start - 1);
    int result = 1;

    if (size > 2 && start[0] == '#' && start[1] == '!' && depth < 5) {
        char *program = start + 2 + strspn(start + 2, " \t");
        program[strcspn(program, " \t\n")] = 0;
        result = loads_library(program, depth + 1);
    } else if (size > (ssize_t)sizeof *header && !memcmp(start, ELFMAG, SELFMAG)) {
        result = 0;
        if (start[EI_CLASS] == (sizeof(void *) == 8 ? ELFCLASS64 : ELFCLASS32))
            for (size_t at = 0; at < header->e_phnum; at++) {
                ElfW(Phdr) *part = (ElfW(Phdr) *)(start + header->e_phoff + at * header->e_phentsize);
                result |= (char *)(part + 1) <= start + size && part->p_type == PT_INTERP;
            }
    }
    if (descriptor >= 0) {
        if (!fstat(descriptor, &status) && status.st_mode & S_ISUID && status.st_uid != geteuid())
            result = 0;
        kernel()(SYS_close, descriptor);
    }
    return result;
}

/* Return 1 with EACCES if a program would find the last build in place of the stage. */
static int finds_last_build(const char *file)
{
    int saved = errno;

    if (stage && *file && !loads_library(file, 0)) {
        note('B', file);
        errno = EACCES;
        return 1;
    }
    errno = saved;
    return 0;
}

static void executing(char kind, const char *file)
{
    char absolute[PATH_MAX];
    int saved = errno;

    if (map) {
        const char *path = strchr(file, '/') && locate(AT_FDCWD, file, absolute) ? absolute : file;
        say(kind, path, strlen(path));
        if (kind == 'X' && path == absolute && !is_kernels(path) && is_there(path))
            note('R', path);
    }
    errno = saved;
}

EXPORT int execve(const char *file, char *const argv[], char *const envp[])
{
    char *const *variables = envp;
    char place[PATH_MAX];
    int result;

    WITH_OBSERVER(variables);
    if (finds_last_build(file))
        return -1;
    executing('X', file);
    result = NEXT(execve)(staged(AT_FDCWD, file, place), argv, (char *const *)variables);
    executing('F', file);
    missing(AT_FDCWD, file);
    return result;
}

#ifdef __GLIBC__
EXPORT int execvpe(const char *file, char *const argv[], char *const envp[])
{
    char *const *variables = envp;
    char place[PATH_MAX];
    int result;

    WITH_OBSERVER(variables);
    if (map)
        note_search(file, place);
    if (map && finds_last_build(strchr(file, '/') ? file : place))
        return -1;
    executing('X', file);
    result = NEXT(execvpe)(strchr(file, '/') ? staged(AT_FDCWD, file, place) : file, argv, (char *const *)variables);
    executing('F', file);
    return result;
}
#else
int execvpe(const char *, char *const[], char *const[]);
#endif

EXPORT int fexecve(int descriptor, char *const argv[], char *const envp[])
{
    char *const *variables = envp;
    int result;

    WITH_OBSERVER(variables);
    executing('X', "a descriptor");
    result = NEXT(fexecve)(descriptor, argv, (char *const *)variables);
    executing('F', "a descriptor");
    return result;
}

static int execute_at(int folder, const char *path, char *const argv[], char *const envp[], int flags)
{
    char *const *variables = envp;
    char absolute[PATH_MAX], place[PATH_MAX];
    const char *file = *path && locate(folder, path, absolute) ? absolute : "a descriptor";
    int result;

    WITH_OBSERVER(variables);
    if (file == absolute && finds_last_build(file))
        return -1;
    executing('X', file);
    result = kernel()(SYS_execveat, folder, staged(folder, path, place), argv, variables, flags);
    executing('F', file);
    missing(folder, path);
    return result;
}

#ifdef __GLIBC__
EXPORT int execveat(int folder, const char *path, char *const argv[], char *const envp[], int flags)
{
    return execute_at(folder, path, argv, envp, flags);
}

EXPORT int open_by_handle_at(int folder, struct file_handle *handle, int flags)
{
    return syscall(SYS_open_by_handle_at, folder, handle, flags);
}
#endif

EXPORT int execv(const char *file, char *const argv[]) { return execve(file, argv, environ); }
EXPORT int execvp(const char *file, char *const argv[]) { return execvpe(file, argv, environ); }

/* The C library's execl() does not call the functions above. */
#define ARGUMENTS(first)                                                        \
    va_list arguments;                                                          \
    size_t count = 1;                                                           \
    char **argv;                                                                \
    va_start(arguments, first);                                                 \
    while (va_arg(arguments, char *))                                           \
        count++;                                                                \
    va_end(arguments);                                                          \
    argv = alloca((count + 1) * sizeof *argv);                                  \
    argv[0] = (char *)first;                                                    \
    va_start(arguments, first);                                                 \
    for (size_t at = 1; at <= count; at++)                                      \
        argv[at] = va_arg(arguments, char *)

EXPORT int execl(const char *file, const char *first, ...)
{
    ARGUMENTS(first);
    va_end(arguments);
    return execve(file, argv, environ);
}

EXPORT int execlp(const char *file, const char *first, ...)
{
    ARGUMENTS(first);
    va_end(arguments);
    return execvpe(file, argv, environ);
}

EXPORT int execle(const char *file, const char *first, ...)
{
    char **variables;

    ARGUMENTS(first);
    variables = va_arg(arguments, char **);
    va_end(arguments);
    return execve(file, argv, variables);
}

#define SPAWN(name, searches)                                                             \
    EXPORT int name(pid_t *process, const char *file, const posix_spawn_file_actions_t *actions, \
                    const posix_spawnattr_t *attributes, char *const argv[], char *const envp[]) \
    {                                                                                     \
        char *const *variables = envp;                                                    \
        char word[16], place[PATH_MAX];                                                   \
        pid_t own, *started = process ? process : &own;                                   \
        int result;                                                                       \
        WITH_OBSERVER(variables);                                                         \
        *place = 0;                                                                       \
        if (map && searches)                                                              \
            note_search(file, place);                                                     \
        if (finds_last_build(strchr(file, '/') ? file : place))                           \
            return errno;                                                                 \
        result = NEXT(name)(started, strchr(file, '/') ? staged(AT_FDCWD, file, place) : file, actions, attributes, \
                            argv, (char *const *)variables);                              \
        if (!result)                                                                      \
            say('S', word, snprintf(word, sizeof word, "%d", (int)*started));             \
        else if (result == ENOENT) {                                                      \
            errno = ENOENT;                                                               \
            missing(AT_FDCWD, file);                                                      \
        }                                                                                 \
        return result;                                                                    \
    }

SPAWN(posix_spawn, 0)
SPAWN(posix_spawnp, 1)

/* The C library opens these files in the new process. */
EXPORT int posix_spawn_file_actions_addopen(posix_spawn_file_actions_t *actions, int descriptor, const char *path,
                                            int flags, mode_t mode)
{
    char place[PATH_MAX];
    int result = NEXT(posix_spawn_file_actions_addopen)(actions, descriptor, staged(AT_FDCWD, path, place), flags, mode);

    if (!result && flags & WRITES)
        changed('W', AT_FDCWD, path);
    else if (!result && is_there(path))
        found('R', AT_FDCWD, path);
    return result;
}

/* System calls */

EXPORT long syscall(long number, ...)
{
    long a, b, c, d, e, f, result;
    char place[PATH_MAX];
    va_list arguments;

    va_start(arguments, number);
    a = va_arg(arguments, long), b = va_arg(arguments, long), c = va_arg(arguments, long);
    d = va_arg(arguments, long), e = va_arg(arguments, long), f = va_arg(arguments, long);
    va_end(arguments);
    if (!map)
        return kernel()(number, a, b, c, d, e, f);
    result = -1;
    switch (number) {
    case SYS_execve: return execve((char *)a, (char **)b, (char **)c);
    case SYS_execveat: return execute_at(a, (char *)b, (char **)c, (char **)d, e);
#ifdef SYS_open
    case SYS_open: case SYS_stat: case SYS_lstat: case SYS_access: case SYS_readlink:
        result = kernel()(number, staged(AT_FDCWD, (char *)a, place), b, c, d, e, f);
        break;
    case SYS_newfstatat:
#endif
#ifdef SYS_openat2
    case SYS_openat2:
#endif
#ifdef SYS_faccessat2
    case SYS_faccessat2:
#endif
    case SYS_openat: case SYS_faccessat: case SYS_statx: case SYS_readlinkat:
        result = kernel()(number, a, staged(a, (char *)b, place), c, d, e, f);
        break;
    default:
        result = kernel()(number, a, b, c, d, e, f);
    }
    switch (number) {
#ifdef SYS_open
    case SYS_open: opened(result, AT_FDCWD, (char *)a, b); break;
    case SYS_stat: case SYS_lstat: case SYS_access: looked(result, AT_FDCWD, (char *)a); break;
    case SYS_readlink: looked(result < 0 ? -1 : 0, AT_FDCWD, (char *)a); break;
    case SYS_getdents: found('L', a, "."); break;
    case SYS_rename: case SYS_link: case SYS_symlink: case SYS_unlink: case SYS_rmdir: case SYS_mkdir: case SYS_creat:
    case SYS_fork: case SYS_vfork:
#endif
    case SYS_renameat2: case SYS_linkat: case SYS_symlinkat: case SYS_unlinkat: case SYS_mkdirat: case SYS_clone:
    case SYS_truncate: case SYS_open_by_handle_at:
        note('B', "a system call");
        break;
    case SYS_openat: opened(result, a, (char *)b, c); break;
#ifdef SYS_newfstatat
    case SYS_newfstatat:
#endif
#ifdef SYS_faccessat2
    case SYS_faccessat2:
#endif
    case SYS_faccessat: case SYS_statx: looked(result, a, (char *)b); break;
    case SYS_readlinkat: looked(result < 0 ? -1 : 0, a, (char *)b); break;
    case SYS_getdents64:
        if (own)
            note('B', "a system call");
        found('L', a, ".");
        break;
#ifdef SYS_openat2
    case SYS_openat2: opened(result, a, (char *)b, *(uint64_t *)c); break;
#endif
    }
    return result;
}
