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

#include "berth/decode/sdo_transfer.hpp"
#include "berth/decode/value_words.hpp"
#include "berth/decode/words.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/od/values.hpp"
#include "berth/trace/trace.hpp"

namespace berth::decode {

/// An object that has its name from elsewhere than the device's description: a network variable of a link.
struct NamedObject {
  ObjectRef object;
  std::string name;
  od::DataType type = od::DataType::none;
};

/// What is known of a device beyond the trace.
struct Profile {
  std::string name;                                                         ///< the slot's; may be empty
  std::shared_ptr<const od::Description> description;                       ///< may be null
  std::vector<std::pair<ObjectRef, std::vector<std::uint8_t>>> settings{};  ///< in place of the defaults
  std::shared_ptr<const ValueWords> words{};                                ///< meaning of values; may be null
  std::vector<NamedObject> named{};                                         ///< preferred to the description's names
};

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
  struct Signal;
  struct Pdo;
  struct Channel;
  struct Node;
  struct Bus;
  struct Route;

  Bus& bus(std::uint16_t number);
  [[nodiscard]] Route route(const Bus& bus, std::uint32_t key) const noexcept;
  void learn(Bus& bus, std::uint8_t node, ObjectRef object, std::span<const std::uint8_t> bytes);
  static void connect(Bus& bus, std::uint8_t node);
  static void disconnect(Bus& bus, std::uint8_t node);
  static void set_route(Bus& bus, std::uint32_t key, Route route);
  static void add_pdo(Bus& bus, Node& node, std::uint8_t id, od::PdoKind kind, unsigned number);
  static bool taken(const Bus& bus, std::uint32_t key);
  void pdo(const Bus& bus, unsigned index, const can::Frame& frame);
  void signals(const Pdo& pdo, const can::Frame& frame);
  void sdo(Channel& channel, bool request);
  void sdo_frame(const Bus& bus, const Channel& channel, bool request);
  void ended(const SdoRecord& record) override;
  void heartbeat(Bus& bus);
  void say_by_profile(const Bus& bus, Meaning meaning);
  void give(Meaning meaning);
  void add_name(std::uint8_t node);
  void put_value(od::DataType type, std::span<const std::uint8_t> bytes, bool all);
  od::DataType say_object(const Node* node, ObjectRef object);
  void say_end(const SdoRecord& record);
  void field(Field::Kind kind, std::string_view key, std::string value);

  Rows* rows_;
  DecodeOptions options_;
  std::vector<std::unique_ptr<Bus>> buses_;
  // For the present entry.
  const trace::Entry* entry_ = nullptr;
  Bus* bus_ = nullptr;
  Channel* channel_ = nullptr;
  std::string words_;
  std::string value_;
  std::vector<Field> fields_;
};

}  // namespace berth::decode
