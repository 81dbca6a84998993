#include "tests/studies/study.h"

#include <map>
#include <utility>

namespace cairn::studies {
namespace {

// Filled before main by the Registrations of the studies linked in; a map, so that their order does not
// matter.
std::map<std::string, Study>& Registered() {
  static std::map<std::string, Study> studies;
  return studies;
}

}  // namespace

Registration::Registration(std::string name, std::string help, RunStudy run) {
  Registered()[name] = {name, std::move(help), std::move(run)};
}

std::vector<Study> AllStudies() {
  std::vector<Study> studies;
  for (const auto& [name, study] : Registered()) studies.push_back(study);
  return studies;
}

}  // namespace cairn::studies
