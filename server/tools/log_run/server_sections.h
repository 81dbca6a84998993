// The sections of cairnd.yaml that a program without a server does not use. They are named here once for all such
// programs, so that each of them can read cairnd's file.
#pragma once

#include "common/options/option_visitor.h"

namespace cairn::server {

// Makes the keys of these sections valid in a file, and ignores them.
inline void IgnoreServerSections(OptionVisitor& visitor) {
  for (const char* section : {"server", "robots", "maps", "jobs", "store", "wire", "ros2"}) visitor.Foreign(section);
}

}  // namespace cairn::server
