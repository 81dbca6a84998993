#include "server/store/store_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, StoreOptions& options) {
  visitor.Integer("commit_delay_ms", options.commit_delay_ms, "ms", 1, 10000,
                  ForOperators("Time during which changes are collected before they are written to the disk together. "
                               "With a larger value the disk has less work, and robots must send more samples again "
                               "after a crash."));
  visitor.Real("max_gib", options.max_gib, "GiB", 0.001, 1e6,
               ForOperators("Disk space for the store. The oldest history that no checkpoint needs is removed first."));
  visitor.Real("max_saved_gib", options.max_saved_gib, "GiB", 0.001, 1e6,
               "Disk space for the files of saved sites. While they take more, no site is saved; delete some of them "
               "with `cairn site delete --saved NAME`.");
  visitor.Integer(
      "queue_mib", options.queue_mib, "MiB", 1, 65536,
      "Memory for changes that wait to be written. If the disk fails and this memory is full, sessions with "
      "further changes are no longer stored.");
}

}  // namespace cairn::server
