#include "common/wire/wire_arguments.h"

#include <cstdlib>

#include "common/options/option_fields.h"

namespace cairn::wire {

Result<void> Apply(const WireArguments& arguments, const VisitOptions& visit) {
  constexpr const char* kVariable = "CAIRN_DOMAIN";
  constexpr const char* kKey = "wire.domain";
  if (const char* of_machine = std::getenv(kVariable); of_machine != nullptr && *of_machine != '\0') {
    if (auto applied = Assign({{kVariable, kKey, of_machine}}, visit); !applied) return applied;
  }
  if (auto applied = ApplySet(arguments.assignments, visit); !applied) return applied;
  if (!arguments.domain) return {};
  return Assign({{"--domain", kKey, std::to_string(*arguments.domain)}}, visit);
}

}  // namespace cairn::wire
