#include "server/ingress/admission.h"

#include <memory>
#include <utility>

namespace cairn::server {
namespace {

bool IsNumber(std::uint64_t sequence) {
  return sequence > 0 && sequence <= kMaxSequence;
}

}  // namespace

ScanArrival Admit(ScanSample&& sample, std::chrono::steady_clock::time_point received) {
  ScanArrival arrival{.stream = sample.stream, .scan = nullptr, .refused = {}, .received = received};
  const auto valid = ValidateScan(sample.scan);
  if (!valid || !IsNumber(sample.scan.sequence)) {
    arrival.refused = valid ? DropReason::kBadGeometry : DropReasonOf(valid.error().fault);
    Scan stub;
    stub.sequence = sample.scan.sequence;
    stub.stamp = sample.scan.stamp;
    arrival.scan = std::make_shared<const Scan>(std::move(stub));
  } else {
    arrival.scan = std::make_shared<const Scan>(std::move(sample.scan));
  }
  return arrival;
}

OdometryArrival Admit(OdometrySample&& sample) {
  return {.stream = sample.stream,
          .odometry = sample.odometry,
          .refused = !IsNumber(sample.odometry.sequence) || !ValidateOdometry(sample.odometry).has_value()};
}

}  // namespace cairn::server
