// Records of the store: a number, then the bytes of one kind of record, or of the envelope around one. What is read is
// written again as the same bytes; an envelope with a right checksum, which a stranger can make, opens to something
// bounded or is refused.
#include "cairn/record.pb.h"
#include "server/store/envelope.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/stored_samples.h"

namespace cairn::fuzz {
namespace {

using namespace server;

// Equal bytes, because a value may hold NaN.
template <typename Stored, typename Read>
bool RoundTrip(const Result<Stored>& read, const Read& read_again) {
  if (!read) {
    Must(read.error().code == StatusCode::kDataLoss && !read.error().message.empty(), "a refusal has a reason");
    return false;
  }
  const std::string bytes = BytesOf(*read);
  const auto again = read_again(bytes);
  Must(again.has_value(), "what was read can be read again");
  Must(BytesOf(*again) == bytes, "a record that was read is written as the same bytes");
  return true;
}

bool RunBatch(std::string_view bytes) {
  const auto batch = BatchOf(bytes);
  if (!batch) return false;
  for (const JournalEntry& entry : batch->entries) {
    if (const auto* scan = std::get_if<ScanTaken>(&entry)) Must(ValidateScan(*scan->scan).has_value(), "a valid scan");
    if (const auto* odometry = std::get_if<OdometryTaken>(&entry))
      Must(odometry->use != OdometryUse::kTaken || ValidateOdometry(odometry->odometry), "valid odometry");
  }
  const std::string written = BytesOf(batch->first, batch->entries);
  const auto again = BatchOf(written);
  Must(again && BytesOf(again->first, again->entries) == written, "a journal is written as the same bytes");
  return true;
}

bool RunEnvelope(std::string_view bytes, bool forged) {
  const RecordKey key{RecordKind::kJournal, 3, 4};
  EnvelopeCodec codec;
  std::string sealed(bytes);
  record::Envelope envelope;
  if (forged && envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    envelope.set_checksum(ChecksumOf(key, envelope));
    sealed = envelope.SerializeAsString();
  }
  const auto content = codec.Open(key, sealed);
  if (!content) {
    Must(!content.error().message.empty(), "a refusal has a reason");
    return false;
  }
  Must(!codec.Open({RecordKind::kJournal, 3, 5}, sealed).has_value(), "a record does not open under another key");
  const auto again = codec.Open(key, codec.Seal(key, *content));
  Must(again && *again == *content, "what was sealed opens to the same bytes");
  return true;
}

bool RunRecord(std::string_view input) {
  Pieces pieces(input);
  const std::uint8_t kind = pieces.Take() % 8;
  const std::string_view rest = pieces.rest();
  switch (kind) {
    case 0:
      return RunBatch(rest);
    case 1:
      return RoundTrip(SessionOf(rest), SessionOf);
    case 2:
      return RoundTrip(VersionOf(rest), VersionOf);
    case 3:
      return RoundTrip(SiteOf(rest), SiteOf);
    case 4:
      return RoundTrip(LayerOf(rest), LayerOf);
    case 5:
      return RoundTrip(JobOf(rest), JobOf);
    default:
      return RunEnvelope(rest, kind == 7);
  }
}

std::vector<std::string> SeedsOfRecords() {
  const auto seed = [](char kind, const std::string& bytes) { return std::string(1, kind) + bytes; };
  EnvelopeCodec codec;
  const RecordKey key{RecordKind::kJournal, 3, 4};
  const std::string journal = BytesOf(41, SmallJournal());
  return {seed(0, journal),
          seed(1, BytesOf(testing::SampleSession(5))),
          seed(2, BytesOf(SampleVersion(false))),
          seed(3, BytesOf(server::testing::SampleSiteRecord())),
          seed(4, BytesOf(StoredLayer{6, {}})),
          seed(4, BytesOf(StoredLayer{6, OneChunk()})),
          seed(5, BytesOf(SampleJob(4, JobState::kRunning))),
          seed(6, codec.Seal(key, journal)),
          seed(7, codec.Seal(key, journal)),
          seed(7, codec.Seal(key, std::string(3000, 'x'))),
          seed(7, codec.Seal(key, "short"))};
}

const bool kRecordTarget = Register({"record", &RunRecord, &SeedsOfRecords});

}  // namespace
}  // namespace cairn::fuzz
