/// Interprets a trace: one row per frame, or per whole SDO transfer, with names and values from the devices'
/// descriptions.
///
///     decode::Decoder decoder(rows);
///     decoder.know(bus, NodeId(5), {.name = "left sensor", .description = eds.description});
///     for (const auto& entry : trace.entries) decoder.entry(entry);
///     decoder.finish();                       // transfers that the end of the trace cut off
///
/// Identifiers and PDO mappings come from the description's defaults and `Profile::settings`, and then from SDO
/// transfers in the trace that write or read 1005h, 1014h and 1200h to 1BFFh. Memory depends on the known nodes and the
/// channels in use, not on the length of the trace.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "berth/decode/profile.hpp"
#include "berth/decode/sdo_transfer.hpp"
#include "berth/decode/words.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/od/values.hpp"
#include "berth/trace/trace.hpp"

namespace berth::decode {

/// One part of a row, for programs. Valid during the call only.
struct Field {
  enum class Kind : std::uint8_t { text, number, signal };  ///< signal: `key` is its name
  Kind kind = Kind::text;
  std::string key;
  std::string value;   ///< number: decimal
  ObjectRef object{};  ///< signal: the object in the PDO
};

/// Valid during the call only.
struct Row {
  const trace::Entry* entry = nullptr;  ///< the frame; for a transfer its last one
  rt::Duration began{};                 ///< for a transfer its first frame; else `entry->at`
  unsigned frames = 1;
  Meaning meaning;
  std::string_view words;
  std::span<const Field>
      fields;  ///< object, name, value, meaning, bytes, mode, abort, result; code; kind, number, signals
};

class KnownBus;
struct KnownNode;
struct KnownPdo;
struct Channel;

class Rows {
 public:
  virtual void row(const Row& row) = 0;

 protected:
  ~Rows() = default;
};

struct DecodeOptions {
  bool fold = true;     ///< false: every frame is a row, SDO frames too
  bool fields = false;  ///< fill `Row::fields`
};

class Decoder final : private SdoTransfer::Listener {
 public:
  explicit Decoder(Rows& rows, DecodeOptions options = {});
  ~Decoder();
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  /// Adds what is known of a node, from the next entry on. `bus` as in `Entry::bus`.
  void know(std::uint16_t bus, NodeId node, Profile profile);
  void entry(const trace::Entry& entry);
  /// Rows for transfers that have not ended.
  void finish();
  /// The earliest last frame of all unfinished transfers: if entries come in time order, no later row has an earlier
  /// time. Empty: no transfer is in progress.
  [[nodiscard]] std::optional<rt::Duration> pending() const noexcept;

 private:
  KnownBus& bus(std::uint16_t number);
  void pdo(const KnownBus& bus, unsigned index, const can::Frame& frame);
  void signals(const KnownPdo& pdo, const can::Frame& frame);
  void sdo(Channel& channel, bool request);
  void sdo_frame(const KnownBus& bus, const Channel& channel, bool request);
  void ended(const SdoRecord& record) override;
  void heartbeat(KnownBus& bus);
  void say_by_profile(const KnownBus& bus, Meaning meaning);
  void give(Meaning meaning);
  void add_name(std::uint8_t node);
  void put_value(od::DataType type, std::span<const std::uint8_t> bytes, bool all);
  od::DataType say_object(const KnownNode* node, ObjectRef object);
  void say_end(const SdoRecord& record);
  void field(Field::Kind kind, std::string_view key, std::string value);

  Rows* rows_;
  DecodeOptions options_;
  std::vector<std::unique_ptr<KnownBus>> buses_;
  // For the present entry.
  const trace::Entry* entry_ = nullptr;
  KnownBus* bus_ = nullptr;
  Channel* channel_ = nullptr;
  std::string words_;
  std::string value_;
  std::vector<Field> fields_;
};

}  // namespace berth::decode
