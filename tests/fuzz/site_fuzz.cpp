// The file of a saved site: a number, which says what the rest is. 0: the file. 1: pieces, each a block of a file whose
// lengths and checksums are right, which a stranger can make. 2: pieces, each a kind, an owner, a number and a record,
// in a file in which everything around the records is right as well. 3: as 2, and a server starts on the site.
// What is read can be imported twice, saved again as the same records, merged and deleted.
#include <filesystem>
#include <set>

#include "cairn/record.pb.h"
#include "server/store/checkpoint_writer.h"
#include "server/store/site_edit.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/restored_rooms.h"
#include "tests/fuzz/stored_samples.h"
#include "tests/temp_directory.h"

namespace cairn::fuzz {
namespace {

using namespace server;

using SavedRecords = std::map<RecordKey, std::string>;

template <typename Number>
std::string BytesOfNumber(Number number) {
  return {reinterpret_cast<const char*>(&number), sizeof(number)};
}

// A file with these blocks whose number and checksum are right.
std::string FileOf(const std::vector<std::string>& blocks) {
  std::string bytes = "cairnste" + BytesOfNumber(kSiteFileFormat);
  for (const std::string& block : blocks) bytes += BytesOfNumber(static_cast<std::uint32_t>(block.size())) + block;
  bytes += BytesOfNumber(std::uint32_t{0}) + BytesOfNumber(static_cast<std::uint64_t>(blocks.size()));
  Checksum sum;
  sum.Add(bytes);
  return bytes + BytesOfNumber(sum.value());
}

std::string BlockOf(const RecordKey& key, std::string_view content) {
  static EnvelopeCodec codec;
  record::SavedRecord saved;
  saved.set_kind(static_cast<std::uint32_t>(key.kind));
  saved.set_owner(key.owner);
  saved.set_number(key.number);
  saved.set_envelope(codec.Seal(key, content));
  return saved.SerializeAsString();
}

std::string FileOfPieces(Pieces pieces, bool records) {
  std::vector<std::string> blocks;
  while (!pieces.empty()) {
    RecordKey key;
    if (records) {
      key.kind = static_cast<RecordKind>(pieces.Take() % 9);
      key.owner = pieces.Take();
      key.number = pieces.Take<std::uint16_t>();
      if (key.owner == 0) key.owner = HashName("lab");
    }
    const std::string_view piece = pieces.TakePiece();
    if (piece.empty()) continue;  // The length 0 ends a file.
    blocks.push_back(records ? BlockOf(key, piece) : std::string(piece));
  }
  return FileOf(blocks);
}

template <typename Value>
bool Good(const Result<Value>& result) {
  Must(result.has_value() || !result.error().message.empty(), "a refusal has a reason");
  return result.has_value();
}

// Nothing but what belongs to no site.
bool IsEmpty(const MemoryStore& store) {
  for (const auto& [key, bytes] : store.records())
    if (key.kind != RecordKind::kServer) return false;
  return true;
}

// The site of the store goes into a file and from there into an empty store.
SavedRecords SavedAndLoaded(MemoryStore& store, const std::string& site) {
  // In memory, because the file is flushed to the disk.
  static const TempDirectory directory(std::filesystem::is_directory("/dev/shm")
                                           ? std::filesystem::path("/dev/shm")
                                           : std::filesystem::temp_directory_path());
  const std::filesystem::path path = directory / "again.site";
  Must(WriteSiteFile(store, site, path).has_value(), "what was imported can be saved");
  MemoryStore other;
  Must(ImportSite(other, path).has_value(), "what was saved can be imported");
  return other.records();
}

void EditAndDelete(MemoryStore& store, const std::filesystem::path& path, const SiteFileSummary& first) {
  const std::string& site = first.site.name;
  ImportOptions options{.site = site == "other" ? "another" : "other", .robots = {}};
  int number = 0;
  for (const auto& [session, robot] : first.sessions) options.robots[robot] = "robot" + std::to_string(++number);
  if (!Good(ImportSite(store, path, options))) return;  // A robot may have one of these names.
  static_cast<void>(Good(MergeSites(store, site, options.site, {1.0, 2.0, 0.5})));
  const auto names = SiteNames(store);
  Must(names.has_value(), "the sites have names");
  for (const std::string& name : *names) Must(DeleteSite(store, name).has_value(), "a site can be deleted");
  Must(RemoveRests(store).has_value(), "the rest can be removed");
  Must(IsEmpty(store), "nothing of a deleted site is left");
}

bool RunSite(std::string_view input) {
  static const MemoryFile file;
  Pieces pieces(input);
  const int kind = pieces.Take() % 4;
  const std::filesystem::path path =
      file.With(kind == 0 ? std::string(pieces.rest()) : FileOfPieces(pieces, kind >= 2));
  MemoryStore store;
  const auto imported = ImportSite(store, path);
  if (!Good(imported)) {
    Must(store.records().empty(), "a refused site changes nothing");
    return false;
  }
  Must(SavedAndLoaded(store, imported->site.name) == store.records(), "a site is saved as the same records");
  if (kind == 3) static_cast<void>(StartOn(store));
  EditAndDelete(store, path, *imported);
  return true;
}

struct Saved {
  RecordKey key;
  std::string bytes;
};

constexpr std::uint64_t kLab = 0;  // Stands for the name of the site.

std::vector<Saved> SampleRecords(bool with_grid) {
  CheckpointWriter writer(5, 3, {"the state of session 5"});
  RecordChanges checkpoint;
  writer.AddTo(checkpoint);
  std::vector<Saved> records = {
      {{RecordKind::kSite, kLab, 0}, BytesOf(server::testing::SampleSiteRecord())},
      {{RecordKind::kMapVersion, kLab, 3}, BytesOf(SampleVersion(with_grid))},
      {{RecordKind::kLayer, kLab, 6}, BytesOf(StoredLayer{6, {}})},
      {{RecordKind::kJob, 4, 0}, BytesOf(SampleJob(4, JobState::kRunning))},
      {{RecordKind::kSession, 5, 0}, BytesOf(server::testing::SampleSession(5))},
  };
  for (const Record& part : checkpoint.put) records.push_back({part.key, part.bytes});
  // The number of its last entry is part of its key.
  records.push_back({{RecordKind::kJournal, 5, SmallJournal().size()}, BytesOf(1, SmallJournal())});
  return records;
}

RecordKey KeyOf(RecordKey key) {
  if (key.owner == kLab) key.owner = HashName("lab");
  return key;
}

std::vector<std::string> SeedsOfSites() {
  std::vector<std::string> seeds;
  for (const bool with_grid : {false, true}) {
    std::vector<std::string> blocks;
    std::string pieces, records;
    for (const Saved& saved : SampleRecords(with_grid)) {
      blocks.push_back(BlockOf(KeyOf(saved.key), saved.bytes));
      pieces += Piece(blocks.back());
      records += {static_cast<char>(saved.key.kind), static_cast<char>(saved.key.owner),
                  static_cast<char>(saved.key.number & 0xff), static_cast<char>(saved.key.number >> 8)};
      records += Piece(saved.bytes);
    }
    seeds.push_back('\0' + FileOf(blocks));
    seeds.push_back('\1' + pieces);
    seeds.push_back('\2' + records);
    seeds.push_back('\3' + records);
  }
  return seeds;
}

const bool kSiteTarget = Register({"site", &RunSite, &SeedsOfSites});

}  // namespace
}  // namespace cairn::fuzz
