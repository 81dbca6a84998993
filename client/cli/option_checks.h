// Makes options of the command line from functions that read a text and return a Result<T>. A text that cannot be read
// is a usage error with the message of the Result.
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <functional>
#include <sstream>
#include <string>

#include "common/options/number_text.h"
#include "common/status.h"

namespace cairn::client {

template <typename T, typename Parser>
CLI::Option* AddParsed(CLI::App& app, const std::string& name, T& value, Parser parser, const std::string& help,
                       const std::string& type_name) {
  return app
      .add_option_function<std::string>(
          name,
          [&value, parser, name](const std::string& text) {
            auto parsed = parser(text);
            if (!parsed) throw CLI::ValidationError(name, parsed.error().message);
            value = *parsed;
          },
          help)
      ->type_name(type_name);
}

// A number of the range, its ends included. (CLI::Range lets NaN pass, and prints all digits of its ends.)
inline CLI::Validator InRange(double least, double most) {
  const auto shortest = [](double value) {
    std::ostringstream text;
    text << value;
    return text.str();
  };
  const std::string range = shortest(least) + " to " + shortest(most);
  return CLI::Validator(
      [=](std::string& text) {
        double value = 0.0;
        const bool good = ParseNumber(text, value) && value >= least && value <= most;
        return good ? std::string() : "'" + text + "' is not a number from " + range;
      },
      "");
}

// A finite number above 0, and one that is 0 or above. (CLI::PositiveNumber and CLI::NonNegativeNumber print the
// largest double with all its digits.)
inline CLI::Validator Positive() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0.0;
        const bool good = ParseNumber(text, value) && std::isfinite(value) && value > 0.0;
        return good ? std::string() : "'" + text + "' is not a number above 0";
      },
      "");
}
inline CLI::Validator NotNegative() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0.0;
        const bool good = ParseNumber(text, value) && std::isfinite(value) && value >= 0.0;
        return good ? std::string() : "'" + text + "' is not a number of 0 or above";
      },
      "");
}

// An option that takes a number of the range and shows its default; `unit` stands for the number in the help.
template <typename Number>
CLI::Option* AddNumber(CLI::App& app, const std::string& name, Number& value, double least, double most,
                       const std::string& help, const std::string& unit = CLI::detail::type_name<Number>()) {
  return app.add_option(name, value, help)->check(InRange(least, most))->type_name(unit)->capture_default_str();
}

}  // namespace cairn::client
