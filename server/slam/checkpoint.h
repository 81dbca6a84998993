// A checkpoint is the state of one estimator (ScanPipeline) as bytes, with what a reader must know of it: the version
// of the format, a checksum, and the options of the estimator, which must be the same in the one that loads it.
//
// Bytes, little-endian: "CAIRNEST", format (uint32), checksum (uint64) of all that follows; length (uint64) and text of
// the options, one `key value` a line; the state (state/archive.h). The list of members of every class is part of the
// format: who changes one raises kCheckpointFormat.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/status.h"
#include "server/slam/mapper_options.h"
#include "server/slam/state/archive.h"

namespace cairn::slam {

inline constexpr std::uint32_t kCheckpointFormat = 2;

class Checkpoint {
 public:
  Checkpoint(const MapperOptions& options, StateWriter state);

  // May take long. May be called from any thread, whatever the estimator does meanwhile.
  [[nodiscard]] std::string Bytes() const;

 private:
  std::string options_;
  StateWriter state_;
};

// The part of the bytes that is the state. kDataLoss if they are damaged or no checkpoint; kFailedPrecondition if they
// are of another format, or of an estimator with other options: the message names the first that differs.
[[nodiscard]] Result<std::string_view> OpenCheckpoint(std::string_view bytes, const MapperOptions& options);

}  // namespace cairn::slam
