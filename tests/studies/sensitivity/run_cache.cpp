#include "tests/studies/sensitivity/run_cache.h"

#include <fstream>
#include <iomanip>
#include <limits>
#include <stdexcept>

namespace cairn::studies {

// A line: key, then NAME=VALUE, all apart by tabulators.
RunCache::RunCache(std::filesystem::path file) : file_(std::move(file)) {
  if (file_.empty()) return;
  std::ifstream in(file_);
  for (std::string line; std::getline(in, line);) {
    std::istringstream fields(line);
    std::string key, field;
    std::getline(fields, key, '\t');
    Figures figures;
    while (std::getline(fields, field, '\t')) {
      const std::size_t equals = field.find('=');
      if (equals == std::string::npos) throw std::runtime_error(file_.string() + " holds no runs of this study");
      figures.emplace_back(field.substr(0, equals), std::stod(field.substr(equals + 1)));
    }
    runs_[key] = std::move(figures);
  }
}

const Figures* RunCache::Find(const std::string& key) const {
  const auto found = runs_.find(key);
  return found == runs_.end() ? nullptr : &found->second;
}

void RunCache::Keep(const std::string& key, const Figures& figures) {
  runs_[key] = figures;
  if (file_.empty()) return;
  std::ofstream out(file_, std::ios::app);
  out << key << std::setprecision(std::numeric_limits<double>::max_digits10);
  for (const auto& [name, value] : figures) out << '\t' << name << '=' << value;
  out << '\n' << std::flush;
  if (!out) throw std::runtime_error("cannot write " + file_.string());
}

}  // namespace cairn::studies
