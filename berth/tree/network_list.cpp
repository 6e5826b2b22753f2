#include "berth/tree/network_list.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "berth/base/bytes.hpp"
#include "berth/eds/concise_dcf.hpp"
#include "berth/od/cia302.hpp"
#include "berth/od/paper3.hpp"

namespace berth::tree {
namespace {

namespace cia302 = od::cia302;

constexpr std::uint16_t consumer_heartbeat = 0x1016;
constexpr std::uint16_t producer_heartbeat = 0x1017;

class List {
 public:
  explicit List(const design::Bus& bus) : bus_(bus) {}

  void bus() {
    put({0x102A, 0}, od::DataType::unsigned16, static_cast<std::uint64_t>(bus_.startup.nmt_inhibit.count() / 100'000));
    auto startup = bus_.startup.rules;
    startup.master = true;
    startup.flying = false;
    put32({cia302::nmt_startup, 0}, manager::value_of(startup));
    put32({cia302::boot_time, 0}, static_cast<std::uint64_t>(bus_.startup.boot_time.count() / 1'000'000));
  }

  void slot(const places::SlotSpec& slot, bool held_back, const manager::SlotSettings& settings, Findings& findings) {
    const std::uint8_t sub = slot.id.value();
    manager::SlaveRules rules;
    rules.assigned = true;
    rules.boots = !held_back;
    rules.mandatory = slot.mandatory && !held_back;
    put32({cia302::slave_assignment, sub}, manager::value_of(rules));
    put32({cia302::expected_type, sub}, slot.device_type);
    put32({cia302::expected_vendor, sub}, slot.type.vendor);
    put32({cia302::expected_product, sub}, slot.type.product);
    const bool exact = slot.rule == places::RevisionRule::exact;
    put32({cia302::expected_revision, sub}, exact ? slot.revision.value_or(0) : 0);
    if (slot.software.hardware_number != 0) put32({od::paper3::expected_hardware, sub}, slot.software.hardware_number);
    put32({consumer_heartbeat, ++consumers_},
          std::uint64_t{sub} << 16U | static_cast<std::uint64_t>(milliseconds(bus_.timing.heartbeat_timeout)));
    if (slot.assign == places::Assign::fixed) fixed_.at(sub / 32U) |= std::uint32_t{1} << sub % 32U;
    const auto more = settings.find(slot.name.name);
    configuration(slot, more == settings.end() ? nullptr : more->second.get(), findings);
  }

  // Objects that the list already has stay.
  void own(const manager::Configuration& more) {
    auto wanted = manager::wanted(more, bus_.master);
    if (!wanted) return;
    for (auto& entry : wanted->entries) {
      const bool taken =
          std::ranges::find(wanted_.entries, entry.object, &manager::Entry::object) != wanted_.entries.end();
      if (!taken && !entry.compare_only) wanted_.entries.push_back(std::move(entry));
    }
  }

  manager::Wanted done() {
    const bool any = std::ranges::any_of(fixed_, [](std::uint32_t bits) { return bits != 0; });
    for (std::uint8_t i = 0; any && i < fixed_.size(); ++i) {
      put32({od::paper3::fixed_node_ids, static_cast<std::uint8_t>(i + 1)}, fixed_.at(i));
    }
    auto& entries = wanted_.entries;
    std::ranges::sort(entries, {}, &manager::Entry::object);
    wanted_.file = "the network list of bus " + bus_.name;
    wanted_.date = date();
    return std::move(wanted_);
  }

 private:
  static std::uint16_t milliseconds(design::Duration time) noexcept {
    return static_cast<std::uint16_t>(std::clamp<std::int64_t>(time.count() / 1'000'000, 0, 0xFFFF));
  }
  void put(ObjectRef object, od::DataType type, std::vector<std::uint8_t> bytes) {
    manager::Entry entry;
    entry.object = object;
    entry.type = type;
    entry.bytes = std::move(bytes);
    wanted_.entries.push_back(std::move(entry));
  }
  void put(ObjectRef object, od::DataType type, std::uint64_t value) {
    std::vector<std::uint8_t> bytes(od::byte_size(type));
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(value >> 8 * i);
    put(object, type, std::move(bytes));
  }
  void put32(ObjectRef object, std::uint64_t value) { put(object, od::DataType::unsigned32, value); }

  // `config =`, and over it the settings for the machine's links.
  static std::optional<manager::Configuration> configured(const places::SlotSpec& slot,
                                                          const manager::Configuration* more, Findings& findings) {
    std::optional<manager::Configuration> all;
    if (!slot.config.empty()) {
      auto loaded = manager::load_configuration(slot.config);
      findings.insert(findings.end(), loaded.findings.begin(), loaded.findings.end());
      if (!loaded.usable()) return std::nullopt;
      all = std::move(loaded.configuration);
    }
    if (more != nullptr) all = all ? manager::joined(*all, *more) : *more;
    return all;
  }

  void configuration(const places::SlotSpec& slot, const manager::Configuration* more, Findings& findings) {
    const std::uint8_t sub = slot.id.value();
    eds::ConciseDcf stream;
    manager::ConfigurationDate expected;
    const auto all = configured(slot, more, findings);
    const auto wanted = all ? manager::wanted(*all, slot.id) : manager::Wanted{};
    if (wanted) {
      for (const auto& entry : wanted->entries) {
        if (!entry.compare_only && entry.object.index != producer_heartbeat)
          stream.entries.push_back({entry.object, entry.bytes});
      }
      // Without an expected date the gateway's master downloads it at each boot-up (CiA 302-2 §Boot-up, step 7).
      if (slot.configuring.when == places::Configure::by_date) expected = wanted->date;
    }
    std::vector<std::uint8_t> period(2);
    store_le(period.data(), milliseconds(bus_.timing.heartbeat_period));
    stream.entries.push_back({{producer_heartbeat, 0}, period});
    const bool in_order = stream.entries.size() > 1;
    put({cia302::concise_dcf, sub}, od::DataType::domain,
        eds::encode(in_order ? eds::in_working_order(stream) : stream));
    put32({cia302::configuration_date, sub}, expected.days);
    put32({cia302::configuration_time, sub}, expected.ms);
  }

  // FNV-1a over all entries.
  [[nodiscard]] manager::ConfigurationDate date() const noexcept {
    std::uint64_t hash = 0xCBF2'9CE4'8422'2325U;
    const auto add = [&](std::uint8_t byte) { hash = (hash ^ byte) * 0x0000'0100'0000'01B3U; };
    for (const auto& entry : wanted_.entries) {
      add(static_cast<std::uint8_t>(entry.object.index));
      add(static_cast<std::uint8_t>(entry.object.index >> 8U));
      add(entry.object.sub);
      for (const auto byte : entry.bytes) add(byte);
    }
    constexpr std::uint32_t a_day = 86'400'000;
    return {.days = 1 + static_cast<std::uint32_t>(hash >> 32U) % 36'500,
            .ms = 1 + static_cast<std::uint32_t>(hash) % (a_day - 1)};
  }

  const design::Bus& bus_;
  manager::Wanted wanted_;
  std::uint8_t consumers_ = 0;
  std::array<std::uint32_t, 4> fixed_{};  // 5F05h
};

}  // namespace

manager::Wanted network_list(const design::Bus& bus, std::span<const places::SlotSpec> slots,
                             std::span<const NodeId> held_back, const manager::SlotSettings& settings,
                             Findings& findings) {
  List list(bus);
  list.bus();
  for (const auto& slot : slots) {
    const bool waits = std::ranges::find(held_back, slot.id) != held_back.end();
    list.slot(slot, waits, settings, findings);
  }
  const auto own = settings.find(design::gateway_node_name(bus));
  if (own != settings.end()) list.own(*own->second);
  return list.done();
}

}  // namespace berth::tree
