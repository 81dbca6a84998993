// Follows the map of one site: a TileMirror kept up to date by the wire. Gets the whole current map on joining, then
// what changes. Where nothing arrives although the server has a newer map, it joins the domain anew (SilenceWatch).
// Thread rule: every method from any thread; `on_change` runs on the wire's threads, may call the methods, and must
// return soon.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/lib/query_client.h"
#include "client/lib/silence_watch.h"
#include "client/lib/tile_mirror.h"
#include "common/mutex.h"
#include "common/wire/bus.h"

namespace cairn::client {

class MapClient {
 public:
  [[nodiscard]] static Result<std::unique_ptr<MapClient>> Create(wire::Bus& bus, const std::string& site,
                                                                 std::function<void()> on_change = {});
  ~MapClient();

  // Waits until every tile the server announces is here. kUnavailable: no server; kNotFound: it has no such site;
  // kDeadlineExceeded: some tiles are still missing.
  [[nodiscard]] Result<void> WaitComplete(double timeout_s);

  // Tiles that the server has answered (QueryClient::Tiles), for those who cannot wait until the wire brings them: of a
  // large map that takes seconds. What the wire brings replaces them.
  void Fill(TileAnswer&& answer);

  // All of one epoch.
  [[nodiscard]] std::vector<Tile> tiles() const;
  [[nodiscard]] std::vector<Tile> tiles(int level) const;
  [[nodiscard]] std::optional<Tile> tile(const TileKey& key) const;
  // For a program that shows the map: what to fetch anew. A default place asks for everything.
  [[nodiscard]] TileChanges ChangesSince(const TileChanges::Place& place) const;
  [[nodiscard]] std::optional<MapInfo> info() const;
  [[nodiscard]] std::uint32_t epoch() const;
  [[nodiscard]] std::uint64_t version() const;
  [[nodiscard]] int renewed() const;  // Times it joined anew.

 private:
  struct Version {
    Generation generation = 0;
    std::uint32_t epoch = 0;
    std::uint64_t version = 0;
    bool operator==(const Version&) const = default;
  };
  struct Wire {
    std::unique_ptr<wire::Bus> own;  // Null for the first, which uses the caller's.
    std::unique_ptr<wire::Subscription> map;
    std::unique_ptr<wire::Subscription> tiles;
  };

  MapClient(wire::Bus& bus, const std::string& site, std::function<void()> on_change);
  template <typename Value>
  void Apply(int number, Value&& value);
  [[nodiscard]] Result<std::unique_ptr<Wire>> Connect(wire::Bus& bus, int number);
  [[nodiscard]] bool Behind(QueryClient& queries);
  // Whether the newest tile that the description of the map knows of has not come.
  [[nodiscard]] bool MissesTiles() const CAIRN_REQUIRES(mutex_);
  // Of the map that was described last.
  [[nodiscard]] std::optional<Version> DescribedVersion() const CAIRN_REQUIRES(mutex_);
  void Renew();

  wire::Bus& bus_;
  const std::string site_;
  const std::function<void()> on_change_;
  mutable Mutex mutex_;
  CondVar changed_;
  std::optional<TileMirror> mirror_ CAIRN_GUARDED_BY(mutex_);
  int number_ CAIRN_GUARDED_BY(mutex_) = 0;                        // The number of the wire whose values count.
  std::optional<Version> missed_before_ CAIRN_GUARDED_BY(mutex_);  // Of the map when it joined anew last.
  SilenceWatch watch_;
  // Last: its callbacks use everything above.
  std::unique_ptr<Wire> wire_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::client
