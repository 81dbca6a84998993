// Repairs of Fast DDS 2.9 from outside. This header may be included only inside common/wire.
#pragma once

namespace cairn::wire {

// Does nothing. A program that calls it has the functions of library_repairs.cpp, which take the place of the
// library's.
void UseRepairs();

}  // namespace cairn::wire
