// cairn: the command line of the mapping service. RunCairn does all work; this file handles signals and exceptions.
#include <exception>
#include <iostream>

#include "client/cli/interrupt.h"
#include "client/cli/program.h"

int main(int argc, char** argv) {
  cairn::client::CatchInterrupts();
  try {
    return static_cast<int>(
        cairn::client::RunCairn(std::vector<std::string>(argv + 1, argv + argc), std::cout, std::cerr));
  } catch (const std::exception& error) {
    std::cerr << "cairn: " << error.what() << "\n";
    return static_cast<int>(cairn::client::ExitCode::kFailed);
  }
}
