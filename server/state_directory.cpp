#include "server/state_directory.h"

#include <cstdlib>

namespace cairn::server {
namespace {

std::string Environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string() : std::string(value);
}

}  // namespace

Result<std::filesystem::path> StateDirectory(const std::string& typed, std::int64_t domain) {
  if (!typed.empty()) return typed;
  if (const std::string state = Environment("CAIRN_STATE"); !state.empty()) return state;
  // systemd names several directories with colons between them; the first one is ours.
  if (const std::string state = Environment("STATE_DIRECTORY"); !state.empty()) return state.substr(0, state.find(':'));
  const std::string own = "domain-" + std::to_string(domain);
  if (const std::string state = Environment("XDG_STATE_HOME"); !state.empty())
    return std::filesystem::path(state) / "cairn" / own;
  if (const std::string home = Environment("HOME"); !home.empty())
    return std::filesystem::path(home) / ".local" / "state" / "cairn" / own;
  return Fail(StatusCode::kInvalidArgument, "there is no place for the state: name a directory with --state");
}

}  // namespace cairn::server
