// Replaces the allocation of memory of the whole program, so that a test can let one allocation of a thread fail. Only
// one source of a program may include it, and not with sanitizers, which replace it themselves. Small allocations never
// fail: Asio does not survive that of a strand's mutex (40 bytes).
#pragma once

#include <cstdlib>
#include <new>

namespace cairn::test {

inline constexpr std::size_t kSmallAllocation = 64;
inline thread_local long allocations_left = -1;  // Of this thread, until one fails. Below 0: all succeed.

inline bool AllocationFails(std::size_t size) {
  if (size <= kSmallAllocation || allocations_left < 0) return false;
  return allocations_left-- == 0;  // What is needed to say so succeeds.
}

// Whether `act` has met a failing allocation, and failed, if so many on this thread before it have succeeded.
template <typename Act>
bool FailsAtAllocation(long number, Act act) {
  allocations_left = number;
  try {
    act();
  } catch (const std::bad_alloc&) {
  }
  const bool failed = allocations_left < 0;
  allocations_left = -1;
  return failed;
}

}  // namespace cairn::test

void* operator new(std::size_t size) {
  if (cairn::test::AllocationFails(size)) throw std::bad_alloc();
  if (void* const memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
// Not inlined: gcc then sees `free` beside `new` and takes it for a mistake.
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
