// A checkpoint is the state of one estimator (ScanPipeline) as bytes. It also contains the version of the format, a
// checksum, and the options of the estimator. An estimator can load it only if it has the same options; OptionsOf says
// which they are. Options that came later have their defaults, and those that are gone do not count, so that a new
// option makes no checkpoint useless.
//
// Bytes, little-endian: "CAIRNEST", format (uint32), checksum (uint64) of all that follows; length (uint64) and text of
// the options, one `key value` a line; the state (state/archive.h). The list of members of every class is part of the
// format: if one changes, kCheckpointFormat must be raised, and the formats from 7 on, which tests/golden has, must
// still be read.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/status.h"
#include "server/slam/mapper_options.h"
#include "server/slam/state/archive.h"

namespace cairn::slam {

inline constexpr std::uint32_t kCheckpointFormat = kStateFormat;
inline constexpr std::uint32_t kOldestCheckpointFormat = 7;

class Checkpoint {
 public:
  Checkpoint(const MapperOptions& options, StateWriter state);

  // May take long. May be called from any thread, even while the estimator runs.
  [[nodiscard]] std::string Bytes() const;
  // The same in two parts (StateWriter::Main); the checksum is that of the main part.
  [[nodiscard]] std::string Main() const;
  [[nodiscard]] const std::vector<StatePiece>& pieces() const { return state_.pieces(); }

 private:
  [[nodiscard]] std::string With(const std::string& state) const;

  std::string options_;
  StateWriter state_;
};

// Returns the part of the bytes that is the state. kDataLoss: they are damaged or no checkpoint. kFailedPrecondition:
// they have an older format, or come from an estimator with other options; the message names the first one that
// differs. kUnimplemented: they have a newer format.
struct OpenedCheckpoint {
  std::string_view state;
  std::uint32_t format = 0;
};
[[nodiscard]] Result<OpenedCheckpoint> OpenCheckpoint(std::string_view bytes, const MapperOptions& options);

// The options with which the checkpoint was made. A known map of lines is not in it: that of `here` is taken, and
// OpenCheckpoint tells whether it is the same. Errors as OpenCheckpoint.
[[nodiscard]] Result<MapperOptions> OptionsOf(std::string_view bytes, const MapperOptions& here);

}  // namespace cairn::slam
