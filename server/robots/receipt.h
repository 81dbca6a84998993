// Tells somebody who has given a session an order what became of it: that the estimator has it and the journal knows
// it, or, where the last copy goes without that, that it was not taken. Thread rule: any thread, once.
#pragma once

#include <functional>
#include <utility>

namespace cairn::server {

class Receipt {
 public:
  explicit Receipt(std::function<void(bool taken)> tell) : tell_(std::move(tell)) {}
  Receipt(const Receipt&) = delete;
  Receipt& operator=(const Receipt&) = delete;
  ~Receipt() { Tell(false); }

  void Taken() { Tell(true); }
  // Nobody is told: the order was refused at once.
  void Cancel() { tell_ = nullptr; }

 private:
  void Tell(bool taken) {
    if (const auto tell = std::exchange(tell_, nullptr)) tell(taken);
  }

  std::function<void(bool taken)> tell_;
};

}  // namespace cairn::server
