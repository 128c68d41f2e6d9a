// Loaded before a program (LD_PRELOAD): makes allocations fail. QUADRIG_FAULTS says how:
//   each       at every allocation the process forks, and in the child that one fails; what the child does is held
//              against the rules below, and the parent goes on. For programs of one thread. Where files are written,
//              which a child would meddle with, it stops, and the log gets a line `writing N`.
//   N          the N-th fails, once, from 1. For programs of any number of threads.
//   count      none fails.
// QUADRIG_FAULTS_LOG gets a line a fault that was not clean, and at the end the number of allocations.
// Of `each`: QUADRIG_FAULTS_FOLDER is a folder whose entries are counted, QUADRIG_FAULTS_STEP tries one of so many, and
// QUADRIG_FAULTS_DONE is the number of entries more where the child ends with 0. A child is clean when it ends by
// itself within 20 seconds with a code that is not 1, has written nothing and one line on standard error; or with 0,
// having written all its files: a failure that was gone round.
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

enum class Mode { off, each, one, count };

// What dlsym asks for before the real functions are known.
alignas(16) char early[1 << 16];
std::atomic<std::size_t> early_used{0};
void* from_early(std::size_t size) {
  const std::size_t rounded = (size + 15) / 16 * 16, begin = early_used.fetch_add(rounded);
  return begin + rounded <= sizeof early ? early + begin : nullptr;
}
bool is_early(const void* place) { return place >= early && place < early + sizeof early; }

void* (*real_malloc)(std::size_t) = nullptr;
void* (*real_calloc)(std::size_t, std::size_t) = nullptr;
void* (*real_realloc)(void*, std::size_t) = nullptr;
void (*real_free)(void*) = nullptr;
int (*real_posix_memalign)(void**, std::size_t, std::size_t) = nullptr;
void* (*real_aligned_alloc)(std::size_t, std::size_t) = nullptr;

Mode mode = Mode::off;
std::atomic<long> count{0};
long fail_at = 0, step = 1, done_entries = 0, before_entries = 0;
int log_file = -1;
const char* folder = nullptr;
thread_local bool inside = false;

long entries() {
  long found = 0;
  if (DIR* open = folder ? opendir(folder) : nullptr) {
    while (readdir(open)) ++found;
    closedir(open);
  }
  return found;
}

void empty_of_new() {  // those that a child wrote are the program's outputs, which the parent has yet to write
  if (DIR* open = folder ? opendir(folder) : nullptr) {
    char path[4096];
    while (const dirent* entry = readdir(open)) {
      if (std::strncmp(entry->d_name, "out", 3) != 0) continue;
      std::snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
      unlink(path);
    }
    closedir(open);
  }
}

void log_line(const char* text) {
  if (log_file >= 0 && write(log_file, text, std::strlen(text)) < 0) _exit(99);
}

void judge(long number, int status, int errors) {
  char text[512] = {}, line[800];
  const ssize_t size = pread(errors, text, sizeof text - 1, 0);
  const long found = entries();
  const char* fault = nullptr;
  if (WIFSIGNALED(status))
    fault = "ended by a signal";
  else if (const int code = WEXITSTATUS(status); code == 0)
    fault = found == before_entries + done_entries ? nullptr : "is done without all files";
  else if (code == 1 || code > 12)
    fault = "has no code of its own";
  else if (found != before_entries)
    fault = "left files";
  else if (size <= 0 || std::strncmp(text, "quadrig: ", 9) != 0 || std::strchr(text, '\n') == nullptr)
    fault = "gave no reason";
  if (fault) {
    std::snprintf(line, sizeof line, "%ld: %s (status %d, %ld entries): %s\n", number, fault, status, found, text);
    for (char* c = line; *c && c[1]; ++c)
      if (*c == '\n') *c = ' ';
    log_line(line);
  }
  empty_of_new();
}

/// Files that are being read, opened anew: a child that reads on would move the place where its parent reads.
void read_apart() {
  char name[64];
  for (int file = 3; file < 64; ++file) {
    const off_t place = lseek(file, 0, SEEK_CUR);
    if (place < 0 || (fcntl(file, F_GETFL) & O_ACCMODE) != O_RDONLY) continue;
    std::snprintf(name, sizeof name, "/proc/self/fd/%d", file);
    const int own = open(name, O_RDONLY);
    if (own < 0) continue;
    lseek(own, place, SEEK_SET);
    dup2(own, file);
    close(own);
  }
}

/// Whether this allocation is to fail.
bool fails() {
  if (mode == Mode::off || inside) return false;
  const long number = ++count;
  if (mode == Mode::count) return false;
  if (mode == Mode::one) return number == fail_at;
  if (number % step != 0) return false;
  inside = true;
  if (entries() != before_entries) {
    char line[64];
    std::snprintf(line, sizeof line, "writing %ld\n", number);
    log_line(line);
    mode = Mode::count;
    inside = false;
    return false;
  }
  const int errors = memfd_create("errors", 0);
  const pid_t child = fork();
  if (child == 0) {
    const int nothing = open("/dev/null", O_WRONLY);
    dup2(nothing, STDOUT_FILENO);
    dup2(errors, STDERR_FILENO);
    read_apart();
    alarm(20);
    mode = Mode::off;
    inside = false;
    return true;
  }
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (child > 0)
    judge(number, status, errors);
  else
    log_line("no process could be made\n");
  close(errors);
  inside = false;
  return false;
}

template <class Function>
void find(Function& function, const char* name) {
  *reinterpret_cast<void**>(&function) = dlsym(RTLD_NEXT, name);
}

void prepare() {
  static std::atomic<bool> begun{false};
  if (begun.exchange(true)) return;
  find(real_calloc, "calloc");
  find(real_realloc, "realloc");
  find(real_free, "free");
  find(real_posix_memalign, "posix_memalign");
  find(real_aligned_alloc, "aligned_alloc");
  find(real_malloc, "malloc");
}

__attribute__((constructor)) void begin() {
  prepare();
  const char* how = std::getenv("QUADRIG_FAULTS");
  const char* log = std::getenv("QUADRIG_FAULTS_LOG");
  if (!how || !log) return;
  log_file = open(log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  folder = std::getenv("QUADRIG_FAULTS_FOLDER");
  if (const char* text = std::getenv("QUADRIG_FAULTS_STEP")) step = std::atol(text);
  if (const char* text = std::getenv("QUADRIG_FAULTS_DONE")) done_entries = std::atol(text);
  before_entries = entries();
  fail_at = std::atol(how);
  mode = std::strcmp(how, "each") == 0 ? Mode::each : std::strcmp(how, "count") == 0 ? Mode::count : Mode::one;
}

__attribute__((destructor)) void end() {
  if (mode == Mode::off) return;
  char line[64];
  std::snprintf(line, sizeof line, "allocations %ld\n", count.load());
  mode = Mode::off;
  log_line(line);
}

}  // namespace

extern "C" {

void* malloc(std::size_t size) {
  if (!real_malloc) prepare();
  if (!real_malloc) return from_early(size);
  if (fails()) return errno = ENOMEM, nullptr;
  return real_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  if (!real_calloc || !real_malloc) return from_early(n * size);  // zero, as all of it is
  if (fails()) return errno = ENOMEM, nullptr;
  return real_calloc(n, size);
}
void* realloc(void* place, std::size_t size) {
  if (!real_realloc) prepare();
  if (is_early(place)) {
    void* fresh = real_malloc(size);
    if (fresh) std::memcpy(fresh, place, size);
    return fresh;
  }
  if (fails()) return errno = ENOMEM, nullptr;
  return real_realloc(place, size);
}
void free(void* place) {
  if (!place || is_early(place)) return;
  if (!real_free) prepare();
  real_free(place);
}
int posix_memalign(void** place, std::size_t alignment, std::size_t size) {
  if (!real_posix_memalign) prepare();
  if (fails()) return ENOMEM;
  return real_posix_memalign(place, alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  if (!real_aligned_alloc) prepare();
  if (fails()) return errno = ENOMEM, nullptr;
  return real_aligned_alloc(alignment, size);
}

}  // extern "C"
