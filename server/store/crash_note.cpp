#include "server/store/crash_note.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <fstream>
#include <system_error>
#include <utility>
#include <vector>

#include "common/mutex.h"

namespace cairn::server {
namespace {

constexpr std::size_t kStackBytes = 65536;
constexpr std::array kSignals{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};

// What the handler reads. A handler may use nothing that allocates memory or takes a lock.
std::array<struct sigaction, kSignals.size()> handlers_before;
std::atomic<int> note_file{-1};
thread_local volatile std::uint64_t working_on = 0;

// The page of the file belongs to the kernel, so it reaches the disk although the process ends now. What another
// process has sent is no crash.
void Note(int signal, siginfo_t* info, void* /*context*/) {
  const int file = note_file.load();
  const std::uint64_t number = working_on;
  const bool own = info->si_code > 0 || info->si_pid == getpid();
  if (own && file >= 0 && number != 0) static_cast<void>(!pwrite(file, &number, sizeof(number), 0));
  for (std::size_t i = 0; i < kSignals.size(); ++i)
    if (kSignals[i] == signal) sigaction(signal, &handlers_before[i], nullptr);
  raise(signal);  // Handled when this function returns, as it would have been without it.
}

}  // namespace

CrashNote::CrashNote(const std::filesystem::path& file) {
  if (file.empty()) return;
  static Mutex making;
  const MutexLock lock(making);
  if (note_file >= 0) return;
  note_file = open(file.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
  if (note_file < 0) return;
  file_ = file;
  struct sigaction action {};
  action.sa_sigaction = Note;
  action.sa_flags = SA_SIGINFO | SA_ONSTACK;
  sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &action, &handlers_before[i]);
}

CrashNote::~CrashNote() {
  if (file_.empty()) return;
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &handlers_before[i], nullptr);
  close(note_file.exchange(-1));
  std::error_code ignored;
  std::filesystem::remove(file_, ignored);
}

// The handler needs a stack of its own where the thread's is used up.
CrashNote::Working::Working(std::uint64_t number) : before_(working_on) {
  thread_local std::vector<char> memory(kStackBytes);
  if (before_ == 0) {
    stack_t stack{};
    stack.ss_sp = memory.data();
    stack.ss_size = memory.size();
    sigaltstack(&stack, &stack_before_);
  }
  working_on = number;
}

CrashNote::Working::~Working() {
  working_on = before_;
  if (before_ == 0) sigaltstack(&stack_before_, nullptr);
}

std::optional<std::uint64_t> CrashNote::Of(const std::filesystem::path& file) {
  if (file.empty()) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  std::uint64_t number = 0;
  if (!in.read(reinterpret_cast<char*>(&number), sizeof(number)) || number == 0) return std::nullopt;
  return number;
}

}  // namespace cairn::server
