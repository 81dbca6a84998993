#include "server/store/store_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, StoreOptions& options) {
  visitor.Integer("commit_delay_ms", options.commit_delay_ms, "ms", 1, 10000,
                  ForOperators("Time during which changes are gathered before they are written to the disk together. A "
                               "larger value costs less, and robots must send more again after a crash."));
  visitor.Real("max_gib", options.max_gib, "GiB", 0.1, 1e6,
               ForOperators("Disk space for the store. The oldest history that no checkpoint needs is removed first."));
  visitor.Integer(
      "queue_mib", options.queue_mib, "MiB", 1, 65536,
      "Memory for what waits to be written. While the disk fails, sessions whose data does not fit any more "
      "are no longer stored.");
}

}  // namespace cairn::server
